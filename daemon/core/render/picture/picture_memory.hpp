// Computes how much memory a picture takes, before anything is allocated for it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "drivers/calibration.hpp"

namespace previz::render {

// A picture is shown in bands of about this many pixels (daemon/core/render/passes/presenter.hpp).
inline constexpr std::size_t most_band_pixels = std::size_t{1} << 21;

// The bytes of a pixel in the largest buffer that every picture needs whole: the camera's rays.
inline constexpr std::size_t whole_pixel_bytes = 2 * sizeof(float);

// The memory that is available for a picture, the device's (memory_of() in
// daemon/core/render/device/gpu.hpp).
struct PictureMemory {
  std::uint64_t bytes = 0;
  std::uint64_t pixels = 0;  // the most that the device can address
  bool read_back = false;    // layers that are read back lie in the same memory
};

// Returns how many bytes are taken by the sums of every pixel, the plate, the camera's rays and a
// band of the shown picture and, with `read_back`, by the layers made from them for the caller.
std::uint64_t picture_bytes(int width, int height, bool read_back);

// Throws previz::Error, with the picture's size, the memory it takes and the memory there is, if
// the picture does not fit or has no pixel.
void refuse_too_large(int width, int height, const PictureMemory& memory);
inline void refuse_too_large(const PinholeIntrinsics& picture, const PictureMemory& memory) {
  refuse_too_large(picture.width, picture.height, memory);
}

// Returns how many bytes of the device's memory a picture's history takes
// (daemon/core/render/passes/history.hpp), where meshes deform.
std::uint64_t history_bytes(int width, int height);

// Offline, a picture is averaged with so many frames on each side, as far as the take has them.
struct Averaging {
  int each_side = 0;
  std::uint64_t take_frames = 0;

  std::uint64_t frames() const;  // those that one picture is averaged from
};

// Returns how many bytes of the computer's memory averaging takes: for the frames that are kept
// (Renderer::keep()), and for the layers of those that wait for the frames after them, or to be
// written.
std::uint64_t kept_bytes(int width, int height, const Averaging& averaging);

// Throws previz::Error, with the memory that averaging takes, the memory there is and what would
// fit, where kept_bytes() are more than `free_bytes`, those that are free in the computer's memory,
// or where the device has no room for a picture and its history. With `memory.read_back` both lie
// in the computer's memory. A picture that is too large by itself is refused as such.
void refuse_too_many_neighbours(int width, int height, const Averaging& averaging,
                                const PictureMemory& memory, std::uint64_t free_bytes);

// Returns how many bytes of the computer's memory the sums of a picture's parts take, where its
// samples are summed in this many (SumTree): one for each level of the tree.
std::uint64_t part_bytes(int width, int height, int parts);
// Throws previz::Error where they are more than `free_bytes`.
void refuse_too_many_parts(int width, int height, int parts, std::uint64_t free_bytes);

}  // namespace previz::render
