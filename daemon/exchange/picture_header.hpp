// Reads the beginning of a picture file, before any decoder gets to see it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace previz::exchange {

struct PictureSize {
  std::uint64_t width = 0, height = 0;
};

// Returns the size that a PNG, a JPEG or a TIFF says it has; nothing for any other file, and for
// one whose size does not stand where these formats have it.
std::optional<PictureSize> picture_size(std::string_view file);

// Throws previz::Error that names the file unless it is a PNG, a JPEG or a TIFF of at most
// most_pixels. OpenCV reads a dozen further formats, with decoders that nobody asked for.
void check_picture_file(const std::filesystem::path& file);

}  // namespace previz::exchange
