// Reads linear RGB pictures from OpenEXR files: environments, and what the lighting stage dumps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::lighting {

struct LinearPicture {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> radiance;  // row-major, linear Rec. 709
};

// An environment of 16384x8192 pixels; light needs no finer one (max_resolution in
// environment.hpp). Twice its 12 bytes a pixel are in memory while it is read.
inline constexpr std::int64_t most_pixels = std::int64_t{1} << 27;

// Reads R, G and B, or Y, of half, float or integer samples; other channels are ignored. Oddities
// that do not prevent its use are appended to `notes`. Throws previz::Error naming the file and,
// if channels are missing, those that it has; a picture of more than most_pixels is refused before
// memory is asked for.
LinearPicture read_exr_picture(const std::filesystem::path& path, std::vector<std::string>& notes);

}  // namespace previz::lighting
