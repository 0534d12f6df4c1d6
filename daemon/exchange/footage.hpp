// Reads pictures from files, one after the other, in a format that a session can hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/frame.hpp"

namespace previz::exchange {

struct Picture {
  PixelFormat format = PixelFormat::rgb8;
  int width = 0, height = 0;
  std::vector<std::uint8_t> bytes;           // laid out as Frame::bytes
  std::string name;                          // for errors: the file, or file and frame
  std::optional<std::int64_t> container_ns;  // a video's own time, from its first frame
};

class Footage {
 public:
  virtual ~Footage() = default;
  // Returns the next picture, or nothing after the last. Throws previz::Error naming the picture
  // that cannot be read.
  virtual std::optional<Picture> next() = 0;
  // Returns the conversions in plain words; they are known after the first picture.
  virtual std::vector<std::string> notes() const { return {}; }
};

// Footage of unknown origin is read by allow-lists of formats and decoders, and no picture of more
// pixels than this: a small file can claim to hold any number.
inline constexpr std::size_t most_pixels = std::size_t{1} << 28;

std::unique_ptr<Footage> open_pictures(std::vector<std::filesystem::path> files);
std::unique_ptr<Footage> open_video(const std::filesystem::path& file);

}  // namespace previz::exchange
