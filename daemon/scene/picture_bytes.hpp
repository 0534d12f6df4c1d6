// Checks and decodes pictures from elsewhere, PNG, JPEG and WebP, without trusting what they claim.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace previz::scene {

struct PictureSize {
  int width = 0, height = 0;  // at least 1, at most max_texture_side
  friend bool operator==(const PictureSize&, const PictureSize&) = default;
};

// Returns the size of a PNG, JPEG or WebP whose bytes may be decoded. Throws previz::Error, "WHERE:
// ...": it is of another kind, animated or damaged, a side is too long, or it claims more than its
// bytes can hold.
PictureSize checked_picture_size(std::span<const unsigned char> bytes, const std::string& where);

bool is_webp(std::span<const unsigned char> bytes);

// Returns why the last picture of this thread, a PNG or JPEG of these bytes, could not be decoded.
std::string picture_failure(std::span<const unsigned char> bytes);

// The texels of a WebP, four bytes each, RGBA, row-major from the top; null where it is damaged.
// The size is that which the bytes say.
struct WebpTexels {
  std::unique_ptr<std::uint8_t, void (*)(void*)> rgba;
  PictureSize size;
};
WebpTexels decoded_webp(std::span<const unsigned char> bytes);

// Returns the luma of each pixel as encoded in the picture (sRGB), row-major from the top.
// `size` is what checked_picture_size returned for these bytes. Throws previz::Error, "WHERE: ...".
std::vector<std::uint8_t> decoded_luma(std::span<const unsigned char> bytes, PictureSize size,
                                       const std::string& where);

}  // namespace previz::scene
