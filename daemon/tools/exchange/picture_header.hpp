// Reads the beginning of a picture file, before any decoder gets to see it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace previz::exchange {

enum class PictureKind { png, jpeg, tiff, webp, dpx, exr };

struct PictureSize {
  std::uint64_t width = 0, height = 0;
};

// Returns the size that a PNG, JPEG, TIFF, WebP or DPX says it has; nothing for any other file, and
// for one whose size does not stand where these formats have it.
std::optional<PictureSize> picture_size(std::string_view file);

// Returns what is wrong with a file of a known kind, and what to do: it is a raw photograph, which
// often is a TIFF with a thumbnail in front, or another format that people have. "" where nothing
// is wrong, or nobody knows what it is.
std::string picture_fault(const std::filesystem::path& file, std::string_view content);

// Returns what the file is. Throws previz::Error that names the file, and what to do, unless it is
// of one of these kinds, without a picture_fault(), and has at most most_pixels. OpenCV and libav
// read dozens of further formats, with decoders that nobody asked for.
PictureKind check_picture_file(const std::filesystem::path& file, std::string_view content);

// Returns whether a TIFF has a plane for each colour, of 16 bits a sample.
bool has_deep_planes(std::string_view tiff);

// Returns what follows the last point of the name, with the point, in small letters.
std::string ending_of(const std::filesystem::path& file);

// Returns whether a file of this name is a picture of a kind that can be read.
bool is_picture_name(const std::filesystem::path& file);

}  // namespace previz::exchange
