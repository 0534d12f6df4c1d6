// What a picture of a size takes, known before anything is allocated for it.
#pragma once

#include <cstdint>

namespace previz::render {

// What there is of it.
struct PictureMemory {
  std::uint64_t bytes = 0;
  std::uint64_t texels = 0;  // that one texel buffer may have
  bool read_back = false;    // what is read back lies in the same memory, and the layers made of it
};

// Bytes that the sums of every pixel and the camera's rays take, and with `read_back` what is made
// of them for the one who asks.
std::uint64_t picture_bytes(int width, int height, bool read_back);

// Throws previz::Error with the picture's size, what it takes and what there is, where it does not
// fit or has no pixel.
void refuse_too_large(int width, int height, const PictureMemory& memory);

}  // namespace previz::render
