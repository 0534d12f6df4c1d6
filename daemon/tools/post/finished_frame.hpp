// The line in DIR/frames.jsonl about a frame that `previz render` has finished.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/tracking/tracker.hpp"

namespace previz::post {

// Observer frames by index in the stream, both ends included.
struct FrameRange {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};

// What a file was when it was written, by which it is checked before a later run keeps it.
struct FileMark {
  std::uint64_t bytes = 0;
  std::string sha256;  // 64 lower-case hexadecimal digits

  friend bool operator==(const FileMark&, const FileMark&) = default;
};

// The device that a frame was rendered on. Pictures of a processor and of a graphics card differ in
// their last bits, and so do those of different cards.
struct MadeOn {
  std::string device;  // its name; empty in a line of a previzd that did not write it
  bool is_gpu = false;

  friend bool operator==(const MadeOn&, const MadeOn&) = default;
};

enum class FrameStatus { rendered, untouched };

// A line of DIR/frames.jsonl.
struct FinishedFrame {
  std::uint64_t frame = 0;
  std::int64_t timestamp_ns = 0;
  FrameStatus status = FrameStatus::rendered;
  std::string reason;  // untouched: why the plate passed through as it is
  std::int64_t samples = 0;
  double render_s = 0;
  // The most that the process had in memory until then; 0 in a line of a previzd that wrote none.
  std::uint64_t peak_memory_bytes = 0;
  double error = 0;  // estimated if quality.error or .seconds is set
  std::optional<tracking::Pose> pose;
  std::vector<std::uint64_t> light_frames;  // sequence numbers; empty: not from the light camera
  std::vector<lighting::Source> light_sources;
  double light_dropped_share = 0;  // of all luminous flux; lighting.sources.residual = "dropped"
  render::Counters counters;
  // By the file's name in DIR, "0007.exr"; empty in a line of a previzd that wrote none.
  std::map<std::string, FileMark> files;
  MadeOn made_on;
};

// Returns the samples of each pixel of a finished shot, or of its sums; 0: it is untouched.
std::int64_t samples_of(const pipeline::Shot& shot);

// Returns the record of a shot whose pictures are written.
FinishedFrame finished_frame(const pipeline::Shot& shot);

// These write the frame as a line, without the newline, and read it back; from_json throws
// nlohmann::json::exception or std::invalid_argument on a broken line.
std::string to_json(const FinishedFrame& frame);
FinishedFrame from_json(const std::string& line);

// Returns "frame 7", or "frames 1, 3 to 5, 9".
std::string frames_words(const std::vector<std::uint64_t>& frames);

}  // namespace previz::post
