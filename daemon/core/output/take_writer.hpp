// Writes one take to disk, as a session directory with its number, slate and timecode.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/core/session/session.hpp"

namespace previz::output {

// The common beginning of all takes of a set.
struct TakeTemplate {
  std::vector<std::filesystem::path> folders;  // of takes, each perhaps on a disk of its own
  session::SessionInfo info;  // calibrations, set; take: slate, notes and timecode_fps
  std::vector<std::pair<std::string, std::filesystem::path>> assets;
  session::VideoCodec codec = session::VideoCodec::ffv1;  // of the cameras' pictures
};

// Both return a time of day as "HH:MM:SS:FF", without drop-frame: the frames of a second are
// counted at the nearest whole rate.
std::string timecode(std::chrono::nanoseconds since_midnight, double fps);
std::string timecode_of(std::chrono::system_clock::time_point time, double fps);  // local time

// Returns "12A_take007" for slate "12A". Characters that a file system cannot hold, or a shell
// breaks on, become "_".
std::string take_name(const std::string& slate, int number);
// Returns the number in a take's name; nothing if it is none of the slate's.
std::optional<int> take_number(const std::string& name, const std::string& slate);
// Returns one more than the highest number of the slate's takes in the folders, as far as these can
// be read, and more than `used`; 1 if there is none.
int next_take_number(const std::vector<std::filesystem::path>& folders, const std::string& slate,
                     int used = 0);

// Every function throws previz::Error naming the file; data written before stays readable.
class TakeWriter {
 public:
  // Makes the take's directory in this folder, under this number.
  TakeWriter(const TakeTemplate& take, const std::filesystem::path& folder, int number);

  // Returns whether the frame has the format and size of its stream.
  bool fits(const Frame& frame) const;
  // `captured` gives the take its timecode with the first observer frame.
  void write(const Frame& frame, std::chrono::system_clock::time_point captured);
  // Returns whether this is the track of a frame that was written before, found by its time.
  bool has_frame_of(const session::TrackRecord& record) const;
  // Writes the track of a frame that was written before, in order; any other track is ignored.
  void write(session::TrackRecord record);
  void write(const ButtonEvent& event) { writer_.write(event); }
  void write(const session::MarkEvent& mark) { writer_.write(mark); }
  void write_event(std::int64_t timestamp_ns, const std::string& what) {
    writer_.write_event(timestamp_ns, what);
  }
  void mark_good();
  void set_assets(const std::map<std::string, std::string>& assets,
                  const std::vector<session::MissingAsset>& missing) {
    writer_.set_assets(assets, missing);
  }
  void close() { writer_.close(); }
  void set_lost(const session::Losses& lost) { writer_.set_lost(lost); }
  void abandon(const std::string& fault) { writer_.abandon(fault); }  // never throws previz::Error

  const std::filesystem::path& directory() const { return directory_; }
  int number() const { return take_.number; }
  std::uint64_t observer_frames() const { return frame_of_.size(); }
  // Returns how many of the last observer frames have no line in the track.
  std::uint64_t frames_without_track() const { return frame_of_.size() - next_track_; }
  bool has_track() const { return next_track_ > 0; }
  bool is_sound() const { return writer_.is_sound(); }

 private:
  struct Format {
    PixelFormat format;
    int width, height;
    BayerPattern bayer;
    bool operator==(const Format&) const = default;
  };
  static Format format_of(const Frame& frame);

  session::TakeInfo take_;
  const std::filesystem::path directory_;
  session::SessionWriter writer_;
  std::map<std::string, Format> formats_;                     // key: source
  std::unordered_map<std::int64_t, std::uint64_t> frame_of_;  // key: timestamp_ns
  std::uint64_t next_track_ = 0;
};

}  // namespace previz::output
