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
constexpr std::uint64_t layer_bytes = (6 * 3 + 2) * sizeof(float);

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

// The rays of the whole picture, its plate and a band.
std::uint64_t always_on_device(int width, int height) {
  const std::uint64_t pixels = pixels_of(width, height);
  return pixels * (plate_bytes + camera_bytes) + rays_of(width, height) * sizeof(glm::vec2) +
         std::min<std::uint64_t>(pixels, most_band_pixels) * band_bytes;
}

// A render without its pictures: program, driver, scene and paths, as the demo's.
constexpr std::uint64_t program_bytes = 400'000'000;
// Scratch files work with so much of them in memory, and no better with more than the second: what
// is there beyond it is in the kernel's cache.
constexpr std::uint64_t least_resident = 128'000'000, most_resident = 512'000'000;

constexpr const char* smaller = "; make the pictures smaller (--scale)";

std::uint64_t frames_of(const TakeOfPictures& take) {
  return std::min(2 * static_cast<std::uint64_t>(take.each_side) + 1, take.take_frames);
}

}  // namespace

std::uint64_t picture_bytes(int width, int height, bool read_back) {
  return always_on_device(width, height) +
         pixels_of(width, height) * (sum_bytes + (read_back ? layer_bytes : 0));
}

void refuse_too_large(int width, int height, const PictureMemory& memory) {
  const std::string picture = "a picture of " + size_words(width, height);
  if (width < 1 || height < 1) throw Error(picture + " has no pixel");
  if (rays_of(width, height) > memory.pixels)
    throw Error(picture + " exceeds the " + std::to_string(memory.pixels) +
                " pixels that the Vulkan device can address; make it smaller");
  const std::uint64_t bytes = memory.in_scratch ? always_on_device(width, height)
                                                : picture_bytes(width, height, memory.read_back);
  if (bytes > memory.bytes)
    throw Error(picture + " takes " + gigabytes(bytes) + " of memory, but there is only " +
                gigabytes(memory.bytes) + "; make it smaller");
}

std::uint64_t history_bytes(int width, int height) {
  return pixels_of(width, height) * (156 + 12);  // 12 for points that deform
}

TakeMemory take_memory(const TakeOfPictures& take, const PictureMemory& device) {
  const std::uint64_t pixels = pixels_of(take.width, take.height), frames = frames_of(take);
  // Layers are made, wait, and are written; at the take's end those of all that waited for frames
  // after them are made at once. Whoever writes them copies one.
  const std::uint64_t at_once = std::max(take.each_side + 2, 3);
  const std::uint64_t layers = std::min(at_once, take.take_frames);
  const auto levels = static_cast<std::uint64_t>(std::bit_width(static_cast<unsigned>(take.parts)));
  std::uint64_t banded = pixels * (layers * layer_bytes + 3 * sizeof(float));
  if (take.each_side > 0) banded += pixels * frames * sum_bytes;
  if (take.parts > 1) banded += pixels * levels * sum_bytes;
  // Frames are decoded ahead, kept, and shown, as the camera's bytes and as codes.
  std::uint64_t rest =
      program_bytes + pixels * (frames + layers + 2) * (plate_bytes + camera_bytes);
  if (device.read_back) {
    banded += pixels * sum_bytes;
    if (take.each_side > 0) banded += history_bytes(take.width, take.height);
    rest += always_on_device(take.width, take.height);
  }
  return {banded, rest};
}

void refuse_too_large(const TakeOfPictures& take, const PictureMemory& device) {
  refuse_too_large(take.width, take.height, device);
  const std::uint64_t averaged =
      picture_bytes(take.width, take.height, false) + history_bytes(take.width, take.height);
  if (device.read_back || take.each_side == 0 || averaged <= device.bytes) return;
  throw Error("quality.neighbours = " + std::to_string(take.each_side) +
              ": to average a picture of " + size_words(take.width, take.height) + " takes " +
              gigabytes(averaged) + " of the graphics card's memory, and there is " +
              gigabytes(device.bytes) + smaller +
              ", or let every frame stand alone (--neighbours 0)");
}

MemoryPlan plan_memory(const TakeOfPictures& take, const PictureMemory& device,
                       std::optional<std::uint64_t> asked, std::uint64_t free_bytes) {
  constexpr std::uint64_t most_unasked = 4'000'000'000;
  const TakeMemory needed = take_memory(take, device);
  const std::uint64_t usable = free_bytes / 10 * 9;
  const std::uint64_t allowed = std::min(asked.value_or(usable), usable);
  if (needed.whole() <= (asked ? allowed : std::min(allowed, most_unasked))) return {};
  const std::uint64_t least = needed.rest + std::min(least_resident, needed.banded / 2);
  if (least > allowed)
    throw Error("pictures of " + size_words(take.width, take.height) + " take at least " +
                gigabytes(least) + " of the computer's memory, and " + gigabytes(allowed) +
                (asked && *asked < usable
                     ? " are allowed" + std::string(smaller) + ", or allow more (--memory)"
                     : " are free" + std::string(smaller) + ", or close other programs"));
  return {.in_scratch = true, .resident = std::min(allowed - needed.rest, most_resident)};
}

}  // namespace previz::render
