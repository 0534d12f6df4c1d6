// A picture of linear light, and how large one may be.
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
  float pixel_aspect = 1;           // a pixel's width by its height
  double pixels_of_file = 1;        // for one of the picture's, along a side

  glm::vec3& at(int x, int y) { return radiance[index(x, y)]; }
  const glm::vec3& at(int x, int y) const { return radiance[index(x, y)]; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
};

// A picture of 32768x16384 pixels can be read; one of more than 16384x8192 is made coarser
// meanwhile (picture_rows.hpp), because light needs no finer one (max_resolution in
// environment.hpp). Twice its 12 bytes a pixel are in memory.
inline constexpr std::int64_t most_pixels = std::int64_t{1} << 29;
inline constexpr std::int64_t most_kept_pixels = std::int64_t{1} << 27;
inline constexpr std::int64_t most_side = std::int64_t{1} << 16;

// Throws previz::Error naming the file unless the picture, which a small file may claim to be of
// any size, has between one pixel and most_pixels, and sides of most_side at most.
void check_size(const std::filesystem::path& path, std::int64_t width, std::int64_t height);

// Reserves memory for the picture, but no more than a file of this many bytes is likely to fill, so
// that a small file that claims to be large costs no memory before its pixels are met.
void reserve_pixels(LinearPicture& picture, std::uintmax_t bytes);

}  // namespace previz::lighting
