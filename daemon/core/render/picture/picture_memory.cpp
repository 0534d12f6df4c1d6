#include "daemon/core/render/picture/picture_memory.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <glm/vec2.hpp>
#include <string>

#include "daemon/core/render/picture/layers.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// A pixel of Layers has six members of three floats and two of one.
constexpr std::uint64_t bare_layer_bytes = (6 * 3 + 2) * sizeof(float);

// While layers are made, the plate's radiance and its variance
// (daemon/core/render/picture/composite.hpp) are there as well, three doubles each, and what of it
// is clipped, three floats.
constexpr std::uint64_t layer_bytes = bare_layer_bytes + 2 * 3 * sizeof(double) + 3 * sizeof(float);

// A pixel's sums, and those of the light of photons.
constexpr std::uint64_t sum_bytes = sizeof(gpu::GpuPixel) + 4 * sizeof(float);

// A pixel of the plate and of the shown picture is three samples.
constexpr std::uint64_t plate_bytes = 3 * sizeof(std::uint16_t);

// The camera gives a pixel no more bytes than this, where they are not the plate's codes. A smaller
// preview also keeps the codes of the whole plate and of what is shown, and 32 bytes a pixel of
// what it adds (presenter.hpp): below 0.95 of the camera's size it takes less altogether all the
// same.
constexpr std::uint64_t camera_bytes = 3;

// A pixel of a band takes twelve arrays of four floats and one of four halves in the denoiser,
// two of them for the light of photons (denoiser.hpp), one of four floats in the presenter
// (presenter.hpp), a word of flags, and its part of the shown picture, also as the screen has it.
constexpr std::uint64_t band_bytes =
    13 * 4 * sizeof(float) + 4 * sizeof(std::uint16_t) + 2 * sizeof(std::uint32_t) + plate_bytes;

std::uint64_t pixels_of(int width, int height) {
  return static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
}

std::uint64_t rays_of(int width, int height) {
  return (static_cast<std::uint64_t>(width) + 1) * (static_cast<std::uint64_t>(height) + 1);
}

std::string size_words(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

std::string gigabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g GB", static_cast<double>(bytes) / 1e9);
  return text;
}

}  // namespace

std::uint64_t picture_bytes(int width, int height, bool read_back) {
  const std::uint64_t pixels = pixels_of(width, height);
  const std::uint64_t device = pixels * (sum_bytes + plate_bytes + camera_bytes) +
                               rays_of(width, height) * sizeof(glm::vec2) +
                               std::min<std::uint64_t>(pixels, most_band_pixels) * band_bytes;
  return read_back ? device + pixels * layer_bytes : device;
}

void refuse_too_large(int width, int height, const PictureMemory& memory) {
  const std::string picture = "a picture of " + size_words(width, height);
  if (width < 1 || height < 1) throw Error(picture + " has no pixel");
  if (rays_of(width, height) > memory.pixels)
    throw Error(picture + " exceeds the " + std::to_string(memory.pixels) +
                " pixels that the Vulkan device can address; make it smaller");
  const std::uint64_t bytes = picture_bytes(width, height, memory.read_back);
  if (bytes > memory.bytes)
    throw Error(picture + " takes " + gigabytes(bytes) + " of memory, but there is only " +
                gigabytes(memory.bytes) + "; make it smaller");
}

std::uint64_t history_bytes(int width, int height) {
  return pixels_of(width, height) * (156 + 12);  // 12 for points that deform
}

std::uint64_t Averaging::frames() const {
  return std::min(2 * static_cast<std::uint64_t>(each_side) + 1, take_frames);
}

std::uint64_t kept_bytes(int width, int height, const Averaging& averaging) {
  // One that is finished waits for the one that is being written (daemon/tools/post/render.cpp).
  constexpr std::uint64_t finished = 2;
  const std::uint64_t waiting = std::min(
      static_cast<std::uint64_t>(averaging.each_side) + 1 + finished, averaging.take_frames);
  return pixels_of(width, height) *
         (averaging.frames() * (sum_bytes + plate_bytes) + waiting * bare_layer_bytes);
}

std::uint64_t part_bytes(int width, int height, int parts) {
  if (parts < 2) return 0;
  return pixels_of(width, height) * sum_bytes *
         static_cast<std::uint64_t>(std::bit_width(static_cast<unsigned>(parts)));
}

void refuse_too_many_parts(int width, int height, int parts, std::uint64_t free_bytes) {
  const std::uint64_t needed = part_bytes(width, height, parts);
  if (needed <= free_bytes) return;
  throw Error("a picture of " + size_words(width, height) + " with so many samples takes " +
              gigabytes(needed) + " of the computer's memory for the parts of their sum, and " +
              gigabytes(free_bytes) +
              " are free; make the picture smaller (--scale), or give fewer samples (--spp)");
}

void refuse_too_many_neighbours(int width, int height, const Averaging& averaging,
                                const PictureMemory& memory, std::uint64_t free_bytes) {
  refuse_too_large(width, height, memory);
  const int neighbours = averaging.each_side;
  const std::string key = "quality.neighbours = " + std::to_string(neighbours) + ": ";
  const std::uint64_t averaged =
      picture_bytes(width, height, memory.read_back) + history_bytes(width, height);
  if (!memory.read_back && averaged > memory.bytes)
    throw Error(key + "to average a picture of " + size_words(width, height) + " takes " +
                gigabytes(averaged) + " of the graphics card's memory, and there is " +
                gigabytes(memory.bytes) +
                "; make the picture smaller (--scale), or let every frame stand alone "
                "(--neighbours 0)");
  const auto needed = [&](int each_side) {
    return kept_bytes(width, height, {each_side, averaging.take_frames}) +
           (memory.read_back ? averaged : 0);
  };
  if (needed(neighbours) <= free_bytes) return;
  int fitting = neighbours - 1;
  while (fitting > 0 && needed(fitting) > free_bytes) --fitting;
  throw Error(key + "to average " + std::to_string(averaging.frames()) + " frames of " +
              size_words(width, height) + " takes " + gigabytes(needed(neighbours)) +
              " of the computer's memory, and " + gigabytes(free_bytes) +
              " are free; make the picture smaller (--scale), or average fewer (--neighbours " +
              std::to_string(fitting) + (fitting > 0 ? " fits)" : ", every frame stands alone)"));
}

}  // namespace previz::render
