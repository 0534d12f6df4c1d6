#include "daemon/scene/picture_bytes.hpp"

#include <stb_image.h>

#include <cstring>
#include <limits>
#include <memory>

#include "daemon/scene/scene.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// A file has at most this many texels per byte: Deflate packs at most 1032 bytes into one, and a
// PNG of one bit per pixel has 8 pixels in each of those bytes. JPEG is less dense.
constexpr std::uint64_t max_texels_a_byte = 8256;

constexpr unsigned char png_signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr unsigned char jpeg_signature[] = {0xff, 0xd8, 0xff};

bool begins_with(std::span<const unsigned char> bytes, std::span<const unsigned char> signature) {
  return bytes.size() > signature.size() &&
         std::memcmp(bytes.data(), signature.data(), signature.size()) == 0;
}

// stb_image asks for as much memory as a chunk's length says before it reads the chunk: up to 2 GiB
// for a file of a few bytes. Throws previz::Error unless the chunks of a PNG, up to IEND, are in
// its bytes.
void require_chunks(std::span<const unsigned char> png, const std::string& where) {
  std::size_t at = sizeof png_signature;
  for (;;) {
    constexpr std::size_t head = 8, checksum = 4;  // bytes; the head is a length and a name
    if (png.size() - at < head) throw Error(where + ": is cut short: it has no IEND chunk");
    const std::size_t length = std::size_t{png[at]} << 24 | std::size_t{png[at + 1]} << 16 |
                               std::size_t{png[at + 2]} << 8 | png[at + 3];
    const std::string name(png.begin() + static_cast<std::ptrdiff_t>(at + 4),
                           png.begin() + static_cast<std::ptrdiff_t>(at + head));
    if (name == "IEND") return;
    const std::size_t left = png.size() - at - head;
    if (left < checksum || length > left - checksum)
      throw Error(where + ": is cut short: its chunk " + set::one_line(name) + " says " +
                  std::to_string(length) + " bytes, and " + std::to_string(left) + " are left");
    at += head + length + checksum;
  }
}

}  // namespace

std::string picture_failure() {
  const char* reason = stbi_failure_reason();
  return reason ? reason : "damaged";
}

PictureSize checked_picture_size(std::span<const unsigned char> bytes, const std::string& where) {
  const bool is_png = begins_with(bytes, png_signature);
  if (!is_png && !begins_with(bytes, jpeg_signature))
    throw Error(where + ": is neither PNG nor JPEG; export it as PNG or JPEG");
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(where + ": is larger than 2 GiB");
  if (is_png) require_chunks(bytes, where);
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                             &channels) ||
      width < 1 || height < 1)
    throw Error(where + ": cannot be decoded: " + picture_failure());
  if (width > max_texture_side || height > max_texture_side)
    throw Error(where + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                "; a side is at most " + std::to_string(max_texture_side));
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (texels / max_texels_a_byte > bytes.size()) throw Error(where + ": is cut short");
  return {width, height};
}

std::vector<std::uint8_t> decoded_luma(std::span<const unsigned char> bytes, PictureSize size,
                                       const std::string& where) {
  int width = 0, height = 0, channels = 0;
  const auto free = [](void* samples) { stbi_image_free(samples); };
  const std::unique_ptr<stbi_uc, decltype(free)> samples(
      stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                            &channels, 1),
      free);
  if (!samples || width != size.width || height != size.height)
    throw Error(where + ": cannot be decoded: " + picture_failure());
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  return {samples.get(), samples.get() + texels};
}

}  // namespace previz::scene
