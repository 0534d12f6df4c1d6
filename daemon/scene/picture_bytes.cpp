#include "daemon/scene/picture_bytes.hpp"

#include <stb_image.h>
#include <webp/decode.h>

#include <algorithm>
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

// A WebP of one colour has a few bytes, whatever its size; up to here it is taken.
constexpr std::uint64_t most_texels_of_few_bytes = std::uint64_t{4096} * 4096;

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

// "WebP Container Specification" (Google): animations have a flag in their header.
PictureSize webp_size(std::span<const unsigned char> bytes, const std::string& where) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK)
    throw Error(where + ": cannot be decoded: it is a damaged WebP");
  if (features.has_animation != 0)
    throw Error(where + ": is an animated WebP; export it as one picture, as PNG, JPEG or WebP");
  return {features.width, features.height};
}

PictureSize stb_size(std::span<const unsigned char> bytes, const std::string& where) {
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                             &channels) ||
      width < 1 || height < 1)
    throw Error(where + ": cannot be decoded: " + picture_failure(bytes));
  return {width, height};
}

constexpr const char* too_large_in_16_bits =
    "is too large with 16 bits; export it with 8 bits, or 8192 wide";

// A PNG's first chunk has its bits per sample and its kind of colour behind its size.
bool has_16_bits(std::span<const unsigned char> bytes) {
  constexpr std::size_t bits_at = 24;
  return begins_with(bytes, png_signature) && bytes.size() > bits_at && bytes[bits_at] == 16;
}
bool has_16_bits_and_alpha(std::span<const unsigned char> bytes) {
  constexpr std::size_t color_at = 25;
  constexpr unsigned char rgba = 6;
  return has_16_bits(bytes) && bytes.size() > color_at && bytes[color_at] == rgba;
}

}  // namespace

bool is_webp(std::span<const unsigned char> bytes) {
  return bytes.size() > 12 && std::memcmp(bytes.data(), "RIFF", 4) == 0 &&
         std::memcmp(bytes.data() + 8, "WEBP", 4) == 0;
}

WebpTexels decoded_webp(std::span<const unsigned char> bytes) {
  int width = 0, height = 0;
  std::uint8_t* const rgba = WebPDecodeRGBA(bytes.data(), bytes.size(), &width, &height);
  return {{rgba, WebPFree}, {width, height}};
}

std::string picture_failure(std::span<const unsigned char> bytes) {
  const char* const given = stbi_failure_reason();
  const std::string reason = given ? given : "";
  if (has_16_bits(bytes) && (reason == "outofmem" || reason == "too large"))
    return std::string("it ") + too_large_in_16_bits;
  // stb_image tries the formats in turn, and a failed try stays its reason where none follows.
  const bool is_of_a_try = begins_with(bytes, png_signature)
                               ? reason == "no SOI"
                               : reason == "bad png sig" || reason == "unknown image type";
  return reason.empty() || is_of_a_try ? "damaged" : reason;
}

PictureSize checked_picture_size(std::span<const unsigned char> bytes, const std::string& where) {
  const bool is_png = begins_with(bytes, png_signature);
  if (!is_png && !begins_with(bytes, jpeg_signature) && !is_webp(bytes))
    throw Error(where + ": is neither PNG, JPEG nor WebP; export it as PNG or JPEG");
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(where + ": is larger than 2 GiB");
  if (is_png) require_chunks(bytes, where);
  const auto [width, height] = is_webp(bytes) ? webp_size(bytes, where) : stb_size(bytes, where);
  if (width > max_texture_side || height > max_texture_side)
    throw Error(where + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                "; a side is at most " + std::to_string(max_texture_side));
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (has_16_bits_and_alpha(bytes) &&  // which stb_image counts in an int
      texels * 8 > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(where + ": " + too_large_in_16_bits);
  const bool is_small = is_webp(bytes) && texels <= most_texels_of_few_bytes;
  if (!is_small && texels / max_texels_a_byte > bytes.size()) throw Error(where + ": is cut short");
  return {width, height};
}

namespace {

// Returns luma by the weights of stb_image, so that a scan has the same luma in each format.
std::vector<std::uint8_t> webp_luma(std::span<const unsigned char> bytes, PictureSize size,
                                    const std::string& where) {
  const WebpTexels decoded = decoded_webp(bytes);
  if (!decoded.rgba || decoded.size != size)
    throw Error(where + ": cannot be decoded: it is a damaged WebP");
  std::vector<std::uint8_t> luma(static_cast<std::size_t>(size.width) *
                                 static_cast<std::size_t>(size.height));
  const std::uint8_t* texel = decoded.rgba.get();
  for (std::uint8_t& y : luma) {
    y = static_cast<std::uint8_t>((77 * texel[0] + 150 * texel[1] + 29 * texel[2]) >> 8);
    texel += 4;
  }
  return luma;
}

}  // namespace

std::vector<std::uint8_t> decoded_luma(std::span<const unsigned char> bytes, PictureSize size,
                                       const std::string& where) {
  if (is_webp(bytes)) return webp_luma(bytes, size, where);
  int width = 0, height = 0, channels = 0;
  const auto free = [](void* samples) { stbi_image_free(samples); };
  const std::unique_ptr<stbi_uc, decltype(free)> samples(
      stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                            &channels, 1),
      free);
  if (!samples || width != size.width || height != size.height)
    throw Error(where + ": cannot be decoded: " + picture_failure(bytes));
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  return {samples.get(), samples.get() + texels};
}

}  // namespace previz::scene
