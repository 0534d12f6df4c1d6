// Computes how much memory a picture takes, before anything is allocated for it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace previz::render {

// A picture is shown in bands of about this many pixels (daemon/render/presenter.hpp).
inline constexpr std::size_t most_band_pixels = std::size_t{1} << 21;

// The memory that is available for a picture.
struct PictureMemory {
  std::uint64_t bytes = 0;
  std::uint64_t texels = 0;  // the most that one texel buffer may have
  bool read_back = false;    // layers that are read back lie in the same memory
};

// Returns how many bytes are taken by the sums of every pixel, the plate, the camera's rays and a
// band of the shown picture and, with `read_back`, by the layers made from them for the caller.
std::uint64_t picture_bytes(int width, int height, bool read_back);

// Throws previz::Error, with the picture's size, the memory it takes and the memory there is, if
// the picture does not fit or has no pixel.
void refuse_too_large(int width, int height, const PictureMemory& memory);

}  // namespace previz::render
