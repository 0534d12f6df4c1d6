#include "daemon/core/output/shown_frame.hpp"

namespace previz::output {

Frame shown_frame(const Plate& picture, int width, int height, std::uint64_t sequence,
                  std::int64_t timestamp_ns) {
  Frame frame;
  frame.source = "composite";
  frame.sequence = sequence;
  frame.timestamp_ns = frame.arrival_ns = timestamp_ns;
  frame.format = picture.bits == 8 ? PixelFormat::rgb8 : PixelFormat::rgb16;
  frame.width = width;
  frame.height = height;
  frame.bytes.reserve(frame_bytes(frame.format, width, height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto from = static_cast<std::size_t>(y) * picture.height / height * picture.width +
                        static_cast<std::size_t>(x) * picture.width / width;
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const std::uint16_t sample = picture.samples[3 * from + channel];
        frame.bytes.push_back(static_cast<std::uint8_t>(sample & 255));
        if (picture.bits > 8) frame.bytes.push_back(static_cast<std::uint8_t>(sample >> 8));
      }
    }
  return frame;
}

}  // namespace previz::output
