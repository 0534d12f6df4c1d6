#include "daemon/core/session/repair.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/missing.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/video_writer.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

namespace fs = std::filesystem;

// Writes one session into a draft, part by part.
class Repairer {
 public:
  Repairer(const fs::path& damaged, const fs::path& draft, const std::stop_token& stop)
      : damaged_(damaged),
        draft_(draft),
        stop_(stop),
        session_(open_session(damaged, stop)),
        file_(read_session_toml(damaged / "session.toml")) {
    repair_.is_complete = file_.closed && file_.fault.empty();
  }

  Repair run() {
    std::uint64_t all_frames = 0;
    for (const char* source : {"observer", "light", "composite"}) {
      const std::uint64_t frames = write_stream(source);
      if (source == std::string("observer")) repair_.frames = frames;
      all_frames += frames;
    }
    if (all_frames == 0)
      throw Error(damaged_.string() + ": no frame of it can be read; nothing was written");
    std::vector<std::uint64_t> bad_events = read_button_lines(damaged_ / "events.jsonl").bad_lines;
    if (!bad_events.empty())
      session_.missing.push_back("events.jsonl: " + list_of("line", bad_events) +
                                 " unreadable, skipped");
    copy_lines("track.jsonl", read_track_lines(damaged_ / "track.jsonl").bad_lines, {});
    write_assets();
    repair_.lacked = session_.missing;
    std::string words;
    for (const std::string& what : repair_.lacked) add_to_list(words, what, "; ");
    words = "repaired from " + fs::absolute(damaged_).lexically_normal().filename().string() +
            ", which was damaged: " + words;
    copy_lines("events.jsonl", bad_events, to_line(last_ns_, words));
    file_.closed = true;
    file_.fault = repair_.is_complete ? "" : words;
    replace_file(draft_ / "session.toml", to_toml(file_));
    return repair_;
  }

 private:
  void check_stop() const {
    if (stop_.stop_requested())
      throw Error(damaged_.string() + ": its repair was interrupted; nothing was written");
  }

  // Returns how many frames were written; a stream without any is left out.
  std::uint64_t write_stream(const std::string& source) {
    const std::unique_ptr<StreamReader> stream = open_stream(session_, source, stop_);
    if (!stream) return 0;
    StreamFormat& format = file_.streams.at(source);
    const std::optional<std::uint64_t> recorded = format.frames;
    std::vector<std::uint64_t> unreadable;
    std::uint64_t written = 0;
    std::optional<VideoWriter> video;
    std::optional<LineFile> lines;
    for (std::size_t i = 0; i < stream->records().size(); ++i) {
      check_stop();
      const FrameRecord& record = stream->records()[i];
      FramePtr frame;
      try {
        frame = stream->read(i);
      } catch (const Error&) {
        unreadable.push_back(record.frame);
        continue;
      }
      if (!video) {
        video.emplace(draft_ / (source + ".mkv"), format);
        lines.emplace(draft_ / (source + ".jsonl"));
      }
      const VideoWriter::Stamp stamp = video->write(*frame);
      lines->append(to_line(FrameLine{record, stamp.video_ms, stamp.crc32}));
      last_ns_ = std::max(last_ns_, record.timestamp_ns);
      ++written;
    }
    if (video) video->finish();
    if (lines) lines->sync();
    if (!unreadable.empty())
      session_.missing.push_back(source + ".mkv: the pictures of " + list_of("frame", unreadable) +
                                 " cannot be decoded");
    repair_.is_complete = repair_.is_complete && recorded && written == *recorded;
    if (written > 0)
      format.frames = written;
    else
      file_.streams.erase(source);
    return written;
  }

  // Copies the lines but for those of these numbers, and adds one more unless it is empty.
  void copy_lines(const char* name, const std::vector<std::uint64_t>& bad,
                  const std::string& more) {
    if (!bad.empty()) repair_.is_complete = false;
    const bool is_there = fs::exists(fs::symlink_status(damaged_ / name));
    if (!is_there && more.empty()) return;
    const LineFile to(draft_ / name);
    if (is_there) {
      PlainLines from(damaged_ / name);
      std::uint64_t number = 0;
      for (std::string line; from.next(line);) {
        if (!std::ranges::binary_search(bad, ++number)) to.append(line);
        if (bad.size() == most_bad_lines && number == bad.back()) break;
      }
    }
    if (!more.empty()) to.append(more);
    to.sync();
  }

  void write_assets() {
    const std::map<std::string, std::string> all = std::exchange(file_.info.assets, {});
    for (const auto& [as_written, stored] : all) {
      check_stop();
      const fs::path from = damaged_ / stored;
      const std::string hash = from.stem().string();
      const bool is_own = session_.info.assets.contains(as_written);
      if (is_own && fs::is_regular_file(from) && sha256_of(from, stop_) == hash) {
        const std::string name = "assets/" + from.filename().string();
        copy_asset(from, draft_ / name);
        file_.info.assets[as_written] = name;
      } else {
        repair_.is_complete = false;
        file_.info.missing_assets.push_back(
            {as_written, from, hash,
             "the take was damaged, and its repair found it missing or changed"});
      }
    }
    if (fs::exists(draft_ / "assets")) sync_names(draft_ / "assets");
  }

  static void copy_asset(const fs::path& from, const fs::path& to) {
    make_folders(to.parent_path());
    Draft copy(to);
    read_blocks(
        open_plain_file(from), [] { return false; },
        [&](std::string_view block) { copy.file().append(block); });
    copy.put();
  }

  const fs::path damaged_, draft_;
  const std::stop_token stop_;
  Session session_;
  SessionFile file_;
  Repair repair_;
  std::int64_t last_ns_ = 0;  // of the frames that were written
};

}  // namespace

Repair repair_session(const fs::path& damaged, const fs::path& repaired,
                      const std::stop_token& stop) {
  if (fs::exists(fs::symlink_status(repaired)))
    throw Error(repaired.string() +
                ": already exists; repair into another folder, or remove it; nothing was written");
  if (lies_within(damaged, repaired))
    throw Error(repaired.string() + ": lies in the take itself; repair into another folder");
  DraftFolder draft(repaired);
  Repair repair = Repairer(damaged, draft.path(), stop).run();
  draft.put();
  return repair;
}

}  // namespace previz::session
