// What a picture of a size takes, known before anything is allocated for it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace previz::render {

// A picture is shown in bands of about so many pixels (daemon/render/presenter.hpp).
inline constexpr std::size_t most_band_pixels = std::size_t{1} << 21;

// What there is of it.
struct PictureMemory {
  std::uint64_t bytes = 0;
  std::uint64_t texels = 0;  // that one texel buffer may have
  bool read_back = false;    // the layers that are made of it lie in the same memory
};

// Bytes that the sums of every pixel, the camera's rays and a band of what is shown take, and with
// `read_back` the layers that are made of them for the one who asks.
std::uint64_t picture_bytes(int width, int height, bool read_back);

// Throws previz::Error with the picture's size, what it takes and what there is, where it does not
// fit or has no pixel.
void refuse_too_large(int width, int height, const PictureMemory& memory);

}  // namespace previz::render
