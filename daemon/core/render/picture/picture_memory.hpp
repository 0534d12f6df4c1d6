// Computes how much memory a picture takes, before anything is allocated for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

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
  bool in_scratch = false;   // what is worked on in bands lies in files (scratch.hpp)
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

// The pictures of a take that is rendered.
struct TakeOfPictures {
  int width = 0, height = 0;
  int each_side = 0;  // the frames on each side with which a picture is averaged, as far
                      // as there are so many
  std::uint64_t take_frames = 0;  // that the take has
  int parts = 1;                  // in which a frame's samples are summed (part_count())
};

// What rendering them takes of the computer's memory, in bytes.
struct TakeMemory {
  std::uint64_t banded = 0;  // what is worked on in bands, and can lie in scratch files
  std::uint64_t rest = 0;    // all else
  std::uint64_t whole() const { return banded + rest; }
};
TakeMemory take_memory(const TakeOfPictures& take, const PictureMemory& device);

// Throws previz::Error where the memory of a graphics card has no room for a picture and its
// history. A picture that is too large by itself is refused as such.
void refuse_too_large(const TakeOfPictures& take, const PictureMemory& device);

// How a render keeps to the memory that it may take.
struct MemoryPlan {
  bool in_scratch = false;     // what is banded lies in scratch files,
  std::uint64_t resident = 0;  // of which so many bytes stay in memory
};
// Takes scratch files where the whole would be more than the `asked` bytes or nine tenths of what
// is free; nobody has asked: or more than 4 GB. What is free beyond that holds the files all the
// same, as the kernel's cache, which others can have at any time. Throws previz::Error where even
// the rest is more.
MemoryPlan plan_memory(const TakeOfPictures& take, const PictureMemory& device,
                       std::optional<std::uint64_t> asked, std::uint64_t free_bytes);

}  // namespace previz::render
