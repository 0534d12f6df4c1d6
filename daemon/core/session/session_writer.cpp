#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/video_writer.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

struct StreamWriter {
  VideoWriter video;
  LineFile lines;
  std::uint64_t frames = 0;

  StreamWriter(const std::filesystem::path& directory, const std::string& source,
               const StreamFormat& format)
      : video(directory / (source + ".mkv"), format), lines(directory / (source + ".jsonl")) {}

  // The picture is written first, so that a line always has its picture.
  void write(const Frame& frame) {
    const VideoWriter::Stamp stamp = video.write(frame);
    lines.append(to_line(FrameLine{{frames++, frame.sequence, frame.timestamp_ns, frame.arrival_ns,
                                    frame.exposure_s, frame.gain, frame.exposure},
                                   stamp.video_ms,
                                   stamp.crc32}));
  }

  void sync() const {
    video.sync();
    lines.sync();
  }
};

void check(const Frame& frame) {
  const auto fail = [&](const std::string& what) {
    throw Error("frame " + std::to_string(frame.sequence) + " of \"" + frame.source + "\" " + what +
                " and cannot be recorded");
  };
  if (frame.source != "observer" && frame.source != "light" && frame.source != "composite")
    fail("has a source other than \"observer\", \"light\" or \"composite\"");
  // libav's FFV1 decoder silently leaves out slices of a single row or column; none is at 8.
  if (frame.width < 8 || frame.height < 8 || frame.width > 65535 || frame.height > 65535)
    fail("has a width or height outside 8 to 65535 pixels");
  if (frame.bytes.size() != frame_bytes(frame.format, frame.width, frame.height))
    fail("has the wrong length for its format and size");
  if (!std::isfinite(frame.exposure) || frame.exposure <= 0)
    fail("has an exposure that is not positive");
  if (!std::isfinite(frame.exposure_s) || !std::isfinite(frame.gain))
    fail("has a shutter time or gain that is not a finite number");
}

std::string text(const StreamFormat& format) {
  const bool mosaic = format.bayer != BayerPattern::none;
  return std::string(to_string(format.format)) + " " +
         (mosaic ? std::string(to_string(format.bayer)) + " " : "") + std::to_string(format.width) +
         "x" + std::to_string(format.height);
}

void make_empty_directory(const std::filesystem::path& directory) {
  make_folders(directory);
  if (!std::filesystem::is_empty(directory))
    throw Error(directory.string() + ": is not empty; a session needs its own folder");
}

// A folder that its writer holds locked as long as it is written. File systems without locks let
// everybody have it.
OwnedDescriptor locked(const std::filesystem::path& directory, bool& is_anothers) {
  OwnedDescriptor folder(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  is_anothers = folder && ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  return folder;
}

}  // namespace

struct SessionWriter::Impl {
  std::filesystem::path directory;
  OwnedDescriptor lock;  // of the directory
  std::chrono::nanoseconds sync_interval{};
  VideoCodec codec = VideoCodec::ffv1;  // of the cameras
  SessionFile file;
  std::map<std::string, StreamWriter> streams;
  std::unique_ptr<LineFile> track, events;
  std::chrono::steady_clock::time_point synced = std::chrono::steady_clock::now();
  bool ended = false;
  bool has_failed = false;  // the reason is file.fault, if there was memory for it

  void check_open() const {
    if (ended) throw Error(directory.string() + ": the session is closed; nothing can be added");
    if (has_failed) throw Error(directory.string() + ": nothing can be added after " + file.fault);
  }

  // Runs what uses the disk, and keeps its failure in mind. After a failed write or sync the kernel
  // may take for written what is not, and further calls succeed: so the first failure is the end.
  template <typename Action>
  decltype(auto) using_disk(const Action& action) {
    try {
      return action();
    } catch (const std::exception& error) {
      has_failed = true;
      if (file.fault.empty()) file.fault = reason_of(error);
      throw;
    }
  }

  void write_toml() const { replace_file(directory / "session.toml", to_toml(file)); }

  // session.toml announces a stream before its files are there, so that their loss is noticed.
  StreamWriter& open(const Frame& frame) {
    const VideoCodec its_codec = frame.source == "composite" ? VideoCodec::ffv1 : codec;
    const StreamFormat format{frame.format, frame.width, frame.height, {}, frame.bayer, its_codec};
    file.streams[frame.source] = format;
    write_toml();
    StreamWriter& stream =
        streams.try_emplace(frame.source, directory, frame.source, format).first->second;
    sync_names(directory);
    return stream;
  }

  void sync() {
    for (auto& [source, stream] : streams) stream.sync();
    if (track) track->sync();
    if (events) events->sync();
    synced = std::chrono::steady_clock::now();
  }

  void add_asset(const std::string& as_written, const std::filesystem::path& from,
                 const std::string& name) {
    const std::filesystem::path target = directory / "assets" / name;
    try {
      make_folders(target.parent_path());
      if (!std::filesystem::exists(target)) {
        copy(from, target);
      }
    } catch (const std::filesystem::filesystem_error& error) {
      throw Error(from.string() + ": cannot be copied into the session: " + error.code().message());
    }
    file.info.assets[as_written] = "assets/" + name;
  }

  static void copy(const std::filesystem::path& from, const std::filesystem::path& target) {
    Draft draft(target);
    read_blocks(
        from, [] { return false; }, [&](std::string_view block) { draft.file().append(block); });
    draft.put();
  }

  // The file opens at its first line.
  void append(std::unique_ptr<LineFile>& lines, const char* name, const std::string& line) {
    check_open();
    using_disk([&] {
      if (!lines) {
        lines = std::make_unique<LineFile>(directory / name);
        sync_names(directory);
      }
      lines->append(line);
      sync_when_due();
    });
  }

  void sync_when_due() {
    if (std::chrono::steady_clock::now() - synced >= sync_interval) sync();
  }

  void close() {
    if (ended) return;
    if (has_failed) return abandon(file.fault.empty() ? reason_of(std::bad_alloc()) : file.fault);
    using_disk([&] {
      for (auto& [source, stream] : streams) {
        stream.video.finish();
        file.streams[source].frames = stream.frames;
      }
      sync();
      file.closed = true;
      write_toml();
      ended = true;
    });
  }

  void abandon(const std::string& fault) {
    if (ended) return;
    file.closed = false;
    file.fault = fault;
    ended = true;
    try {
      write_toml();
    } catch (const std::exception&) {
      // Without the reason it is still a session that was not closed.
    }
  }
};

SessionWriter::SessionWriter(const std::filesystem::path& directory, const SessionInfo& info,
                             std::chrono::nanoseconds sync_interval, VideoCodec codec)
    : impl_(std::make_unique<Impl>()) {
  impl_->directory = directory;
  impl_->sync_interval = sync_interval;
  impl_->codec = codec;
  impl_->file.info = info;
  make_empty_directory(directory);
  bool is_in_draft = false;  // which is locked already
  impl_->lock = locked(directory, is_in_draft);
  impl_->write_toml();
}

SessionWriter::~SessionWriter() {
  try {
    impl_->close();
  } catch (const std::exception& error) {
    try {
      impl_->abandon(reason_of(error));  // whoever wants to know calls close()
    } catch (const std::exception&) {
      return;  // without the reason it is still a session that was not closed
    }
  }
}

void SessionWriter::write(const Frame& frame) {
  impl_->check_open();
  check(frame);
  const auto found = impl_->streams.find(frame.source);
  StreamWriter& stream =
      found == impl_->streams.end()
          ? impl_->using_disk([&]() -> StreamWriter& { return impl_->open(frame); })
          : found->second;
  const StreamFormat& format = impl_->file.streams.at(frame.source);
  if (frame.format != format.format || frame.bayer != format.bayer || frame.width != format.width ||
      frame.height != format.height)
    throw Error((impl_->directory / (frame.source + ".mkv")).string() + ": frame " +
                std::to_string(frame.sequence) + " is " +
                text(StreamFormat{frame.format, frame.width, frame.height, {}, frame.bayer}) +
                "; the stream is " + text(format) + " from its first frame on");
  impl_->using_disk([&] {
    stream.write(frame);
    impl_->sync_when_due();
  });
}

void SessionWriter::write(const TrackRecord& record) {
  impl_->append(impl_->track, "track.jsonl", to_line(record));
}

void SessionWriter::write(const ButtonEvent& event) {
  impl_->append(impl_->events, "events.jsonl", to_line(event));
}

void SessionWriter::write(const MarkEvent& mark) {
  impl_->append(impl_->events, "events.jsonl", to_line(mark));
}

void SessionWriter::write_event(std::int64_t timestamp_ns, const std::string& what) {
  impl_->append(impl_->events, "events.jsonl", to_line(timestamp_ns, what));
}

void SessionWriter::set_take(const TakeInfo& take) {
  impl_->check_open();
  impl_->file.info.take = take;
  impl_->using_disk([&] { impl_->write_toml(); });
}

void SessionWriter::set_timecode(const Timecode& timecode) {
  impl_->check_open();
  impl_->file.info.timecode = timecode;
  impl_->using_disk([&] { impl_->write_toml(); });
}

void SessionWriter::add_asset(const std::string& as_written, const std::filesystem::path& file) {
  impl_->check_open();
  const std::string name = sha256_of(file) + file.extension().string();
  impl_->using_disk([&] {
    impl_->add_asset(as_written, file, name);
    impl_->write_toml();
  });
}

void SessionWriter::set_assets(std::map<std::string, std::string> assets,
                               std::vector<MissingAsset> missing) {
  SessionFile named = impl_->file;
  named.info.assets = std::move(assets);
  named.info.missing_assets = std::move(missing);
  static_cast<void>(to_toml(named));  // throws here what is not about the disk
  impl_->file = std::move(named);
  if (impl_->ended || !is_sound()) return;
  impl_->using_disk([&] { impl_->write_toml(); });
}

bool SessionWriter::is_sound() const {
  return !impl_->has_failed;
}

void SessionWriter::set_lost(const Losses& lost) {
  impl_->file.lost = lost;
}

void SessionWriter::close() {
  impl_->close();
}

void SessionWriter::abandon(const std::string& fault) {
  impl_->abandon(fault);
}

bool is_being_written(const std::filesystem::path& directory) {
  bool is_anothers = false;
  locked(directory, is_anothers);
  return is_anothers;
}

std::optional<std::uint64_t> salvage(const std::filesystem::path& directory) {
  const std::filesystem::path toml = directory / "session.toml";
  if (!std::filesystem::exists(std::filesystem::symlink_status(toml))) return std::nullopt;
  // A writer locks its folder before it writes session.toml. What this reads under the lock is the
  // last that the writer wrote; before, it might be about to be replaced.
  bool is_anothers = false;
  const OwnedDescriptor lock = locked(directory, is_anothers);
  if (is_anothers) return std::nullopt;
  SessionFile file = read_session_toml(toml);
  if (file.closed || !file.fault.empty()) return std::nullopt;
  const std::uint64_t frames = read_frame_lines(directory / "observer.jsonl").records.size();
  file.fault = "it was cut off by a crash or a power cut";
  replace_file(toml, to_toml(file));
  return frames;
}

void change_take(const std::filesystem::path& directory,
                 const std::function<void(TakeInfo&)>& change) {
  const std::filesystem::path toml = directory / "session.toml";
  SessionFile file = read_session_toml(toml);
  if (!file.info.take) file.info.take.emplace();
  change(*file.info.take);
  replace_file(toml, to_toml(file));
}

}  // namespace previz::session
