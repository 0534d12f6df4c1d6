// open_stream(): joins a stream's lines with the packets of its video.

#include <algorithm>
#include <map>
#include <set>

#include "daemon/core/session/clusters.hpp"
#include "daemon/core/session/ffv1.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/missing.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/video_reader.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

class RecordedStream final : public StreamReader {
 public:
  RecordedStream(std::string source, StreamFormat format, std::unique_ptr<VideoReader> video)
      : source_(std::move(source)), format_(format), video_(std::move(video)) {}

  void add(const FrameLine& line) {
    records_.push_back(line.record);
    packets_.push_back({line.video_ms, line.crc32});
  }

  const std::vector<FrameRecord>& records() const override { return records_; }
  PixelFormat format() const override { return format_.format; }
  BayerPattern bayer() const override { return format_.bayer; }
  int width() const override { return format_.width; }
  int height() const override { return format_.height; }

  FramePtr read(std::size_t index) override {
    if (index >= records_.size())
      throw Error(source_ + " frame " + std::to_string(index) + " was asked for; there are " +
                  std::to_string(records_.size()));
    const FrameRecord& record = records_[index];
    auto frame = std::make_shared<Frame>();
    frame->source = source_;
    frame->sequence = record.sequence;
    frame->timestamp_ns = record.timestamp_ns;
    frame->arrival_ns = record.arrival_ns;
    frame->exposure_s = record.exposure_s;
    frame->gain = record.gain;
    frame->exposure = record.exposure;
    frame->format = format_.format;
    frame->bayer = format_.bayer;
    frame->width = format_.width;
    frame->height = format_.height;
    try {
      frame->bytes = video_->read(packets_[index]);
    } catch (const Error& error) {
      throw Error(source_ + " frame " + std::to_string(record.frame) + ": " + error.what());
    }
    return frame;
  }

 private:
  std::string source_;
  StreamFormat format_;
  std::unique_ptr<VideoReader> video_;
  std::vector<FrameRecord> records_;
  std::vector<VideoReader::PacketInfo> packets_;
};

// Frames and pictures that have no partner once lines are joined with packets.
struct Leftovers {
  std::vector<std::uint64_t> without_picture;  // frames
  std::vector<std::uint64_t> damaged;          // frames
  std::uint64_t without_line = 0;              // pictures

  bool has_lost_pictures() const { return !without_picture.empty() || !damaged.empty(); }
};

struct Joined {
  std::vector<FrameLine> whole;  // lines whose picture is there
  Leftovers left;
};

Joined join(const std::vector<FrameLine>& lines,
            const std::vector<VideoReader::PacketInfo>& packets) {
  std::multimap<std::int64_t, std::uint32_t> unclaimed;
  for (const VideoReader::PacketInfo& packet : packets)
    unclaimed.emplace(packet.video_ms, packet.crc32);
  Joined joined;
  for (const FrameLine& line : lines) {
    const auto [first, last] = unclaimed.equal_range(line.video_ms);
    const auto whole =
        std::find_if(first, last, [&](const auto& packet) { return packet.second == line.crc32; });
    if (whole != last) {
      joined.whole.push_back(line);
      unclaimed.erase(whole);
    } else if (first != last) {
      joined.left.damaged.push_back(line.record.frame);
      unclaimed.erase(first);
    } else {
      joined.left.without_picture.push_back(line.record.frame);
    }
  }
  joined.left.without_line = unclaimed.size();
  return joined;
}

void list_missing(const Leftovers& left, const std::string& source,
                  std::vector<std::string>& missing) {
  const std::string video = source + ".mkv", lines = source + ".jsonl";
  if (!left.damaged.empty())
    missing.push_back(video + ": the pictures of " + list_of("frame", left.damaged) +
                      " are damaged and skipped");
  if (!left.without_picture.empty())
    missing.push_back(video + ": the pictures of " + list_of("frame", left.without_picture) +
                      " are missing");
  if (left.without_line > 0)
    missing.push_back(lines + ": " + count_of("picture", left.without_line) + " of " + video +
                      " have no line with their time and are skipped");
}

// A video as far as it could be opened, joined with its lines.
struct OpenedVideo {
  std::unique_ptr<VideoReader> reader;  // null: no picture can be read
  Joined joined;
  std::string fault;  // why there is no reader
};

OpenedVideo open_video(const std::filesystem::path& file, const StreamFormat& format,
                       const std::vector<FrameLine>& lines, const std::stop_token& stop) {
  OpenedVideo video;
  std::vector<VideoReader::PacketInfo> packets;
  try {
    video.reader = std::make_unique<VideoReader>(file, format);
  } catch (const Error& error) {
    video.fault = std::string("no picture can be read: ") + error.what();
  }
  if (video.reader) packets = video.reader->scan(stop);
  video.joined = join(lines, packets);
  return video;
}

// Where pictures are missing, looks for them one by one, and reads them so if that finds more.
void search_lost(OpenedVideo& video, const std::filesystem::path& file, const StreamFormat& format,
                 const std::vector<FrameLine>& lines, const std::stop_token& stop,
                 std::vector<std::string>& missing) {
  if (!why_not_plain(file).empty()) return;  // which was said
  WantedPackets wanted;
  for (const FrameLine& line : lines) wanted.emplace(line.video_ms, line.crc32);
  const std::vector<PacketPlace> found =
      find_packets(file, std::move(wanted), most_packet_bytes(format), stop);
  const std::size_t before = video.joined.whole.size();
  if (found.size() <= before) return;
  std::vector<VideoReader::PacketInfo> packets;
  for (const PacketPlace& place : found) packets.push_back({place.video_ms, place.crc32});
  const std::uint64_t without_line = video.joined.left.without_line;
  video.joined = join(lines, packets);
  video.joined.left.without_line = without_line;
  video.reader = std::make_unique<VideoReader>(file, format, found);
  video.fault.clear();
  missing.push_back(file.filename().string() +
                    ": its head, or what lies between its pictures, is damaged; " +
                    count_of("picture", found.size() - before) + " of " +
                    std::to_string(lines.size()) + " found one by one, with correct checksums");
}

}  // namespace

std::unique_ptr<StreamReader> open_stream(Session& session, const std::string& source,
                                          const std::stop_token& stop) {
  const std::filesystem::path toml = session.directory / "session.toml";
  const SessionFile file = read_session_toml(toml);
  const std::filesystem::path video_file = session.directory / (source + ".mkv");
  const std::filesystem::path line_file = session.directory / (source + ".jsonl");
  const auto declared = file.streams.find(source);
  if (declared == file.streams.end()) {
    if (std::filesystem::exists(std::filesystem::symlink_status(video_file)))
      session.missing.push_back("session.toml: does not describe " + source +
                                ".mkv, which is skipped");
    return nullptr;
  }
  const StreamFormat& format = declared->second;
  if (!std::filesystem::exists(std::filesystem::symlink_status(line_file)))
    session.missing.push_back(source + ".jsonl: the file is missing");
  const Lines<FrameLine> lines = read_frame_lines(line_file);
  if (!lines.bad_lines.empty())
    session.missing.push_back(source + ".jsonl: " + list_of("line", lines.bad_lines) +
                              " unreadable, skipped");

  OpenedVideo video;
  if (std::filesystem::exists(std::filesystem::symlink_status(video_file))) {
    video = open_video(video_file, format, lines.records, stop);
    if (video.joined.left.has_lost_pictures())
      search_lost(video, video_file, format, lines.records, stop, session.missing);
    if (!video.fault.empty()) session.missing.push_back(video.fault);
  } else {
    video.joined = join(lines.records, {});
    session.missing.push_back(source + ".mkv: the file is missing");
  }
  auto stream = std::make_unique<RecordedStream>(source, format, std::move(video.reader));
  for (const FrameLine& line : video.joined.whole) stream->add(line);
  list_missing(video.joined.left, source, session.missing);
  const std::uint64_t whole = stream->records().size();
  if (const auto recorded = declared->second.frames; recorded && whole < *recorded)
    session.missing.push_back(source + ": " + std::to_string(whole) + " of " +
                              count_of("recorded frame", *recorded) + " are complete");
  return stream;
}

}  // namespace previz::session
