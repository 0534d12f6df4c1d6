// Checks and decodes pictures from elsewhere, PNG, JPEG and WebP, without trusting what they claim.
#pragma once

#include <cstdint>
#include <functional>
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

// A row of a picture as it is encoded: four samples a pixel, R, G, B and A, of which `largest` is
// 1. Grey has three equal ones; a picture without alpha has the largest.
struct PictureRow {
  std::span<const std::uint16_t> rgba;
  int largest = 255;  // or 65535
};

// Calls `take` with each row from the top. `size` is what checked_picture_size() returned for these
// bytes. No profile, gamma or orientation of the file is applied. Throws previz::Error, "WHERE:
// ...", where the picture is damaged, some of whose rows may have been taken.
void decode_rows(std::span<const unsigned char> bytes, PictureSize size, const std::string& where,
                 const std::function<void(const PictureRow&)>& take);

// Returns the luma of each pixel as encoded in the picture (sRGB, ITU-R BT.601), row-major from the
// top. Throws likewise.
std::vector<std::uint8_t> decoded_luma(std::span<const unsigned char> bytes, PictureSize size,
                                       const std::string& where);

}  // namespace previz::scene
