// Encodes the review video: the pictures at the times they were taken, small enough to send around.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/session/timecode.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::output {

// An encoder of libav and the container it goes into.
struct VideoCodec {
  std::string encoder;      // libav's name: "libx264"
  std::string description;  // for the log: "H.264 (libx264)"
  std::string container;    // libav's name: "mp4"
  std::string extension;    // ".mp4"
};

// Returns the codecs for a review video that this machine's libav can open, best first: H.264, then
// MPEG-4 part 2, then FFV1.
std::vector<VideoCodec> review_codecs();

// Encodes to "<stem><extension>", which appears when it is whole. All pictures have one size;
// 16-bit ones are rounded to 8. Pixels are BT.709 limited range, 4:2:0 (4:4:4 where a side is odd).
class VideoWriter {
 public:
  // Throws previz::Error naming the file if it cannot be written. `clock` gives the file its rate
  // and, in MP4, the timecode of the first picture, which is taken at `first_ns`.
  VideoWriter(const std::filesystem::path& stem, int width, int height, const VideoCodec& codec,
              const session::TakeClock& clock = {}, std::int64_t first_ns = 0);
  ~VideoWriter();  // removes an unfinished file
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  // Adds a picture. Times must increase by at least 1/60000 s, the video's clock; the first is the
  // video's time 0.
  void write(const Plate& picture, std::int64_t timestamp_ns);
  // Finishes the file, puts it in place and returns its path.
  std::filesystem::path close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::output
