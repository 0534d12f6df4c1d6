#include "daemon/core/scene/picture_bytes.hpp"

#include <spng.h>
#include <webp/decode.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "daemon/core/scene/scene.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/convert/convert.hpp"
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

[[noreturn]] void refuse_damaged(const std::string& where, const std::string& why) {
  throw Error(where + ": cannot be decoded: " + why);
}

// "WebP Container Specification" (Google): animations have a flag in their header.
PictureSize webp_size(std::span<const unsigned char> bytes, const std::string& where) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK)
    refuse_damaged(where, "it is a damaged WebP");
  if (features.has_animation != 0)
    throw Error(where + ": is an animated WebP; export it as one picture, as PNG, JPEG or WebP");
  return {features.width, features.height};
}

PictureSize jpeg_size(std::span<const unsigned char> bytes, const std::string& where) {
  int width = 0, height = 0;
  if (const auto wrong = convert::jpeg_size(bytes, width, height))
    refuse_damaged(where, "it " + *wrong);
  return {width, height};
}

class PngReader {
 public:
  PngReader(std::span<const unsigned char> bytes, const std::string& where)
      : png_(spng_ctx_new(0), spng_ctx_free), where_(where) {
    constexpr std::size_t most_cached = 1 << 26;
    constexpr std::uint32_t most_side = 0x7fffffff;
    spng_set_image_limits(png_.get(), most_side, most_side);
    spng_set_chunk_limits(png_.get(), most_cached, most_cached);  // as what it unpacks to
    check(spng_set_png_buffer(png_.get(), bytes.data(), bytes.size()));
    check(spng_get_ihdr(png_.get(), &header_));
  }

  PictureSize size() const {
    return {static_cast<int>(header_.width), static_cast<int>(header_.height)};
  }

  // Calls take(samples) with the samples of each row.
  template <typename Sample, typename Take>
  void read(const Take& take) {
    const std::size_t samples = std::size_t{4} * header_.width, bytes = samples * sizeof(Sample);
    constexpr int format = sizeof(Sample) == 1 ? SPNG_FMT_RGBA8 : SPNG_FMT_RGBA16;
    if (header_.interlace_method != SPNG_INTERLACE_NONE) {
      std::vector<Sample> all(samples * header_.height);
      check(spng_decode_image(png_.get(), all.data(), bytes * header_.height, format,
                              SPNG_DECODE_TRNS));
      for (std::size_t y = 0; y < header_.height; ++y) take(&all[y * samples]);
      return;
    }
    std::vector<Sample> row(samples);
    check(spng_decode_image(png_.get(), nullptr, 0, format,
                            SPNG_DECODE_TRNS | SPNG_DECODE_PROGRESSIVE));
    for (std::uint32_t y = 0; y < header_.height; ++y) {
      const int code = spng_decode_row(png_.get(), row.data(), bytes);
      if (code != SPNG_EOI || y + 1 < header_.height) check(code);
      take(row.data());
    }
  }
  bool has_16_bits() const { return header_.bit_depth == 16; }

 private:
  void check(int code) const {
    if (code == 0) return;
    if (code == SPNG_IO_EOF || code == SPNG_EIDAT_TOO_SHORT)
      throw Error(where_ + ": is cut short: a part of it is longer than what is left of the file");
    refuse_damaged(where_, std::string("it is a damaged PNG: ") + spng_strerror(code));
  }

  std::unique_ptr<spng_ctx, void (*)(spng_ctx*)> png_;
  const std::string& where_;
  spng_ihdr header_{};
};

// Calls `take` with what `samples` of a row are in 16 bits.
class RowTaker {
 public:
  RowTaker(int width, const std::function<void(const PictureRow&)>& take)
      : row_(std::size_t{4} * static_cast<std::size_t>(width)), take_(take) {}

  void rgba(const std::uint8_t* samples) {
    std::copy_n(samples, row_.size(), row_.begin());
    take_({row_, 255});
  }
  void rgba(const std::uint16_t* samples) { take_({{samples, row_.size()}, 65535}); }
  void rgb(std::span<const std::uint8_t> samples) {
    for (std::size_t x = 0; x < row_.size() / 4; ++x) {
      std::copy_n(&samples[3 * x], 3, &row_[4 * x]);
      row_[4 * x + 3] = 255;
    }
    take_({row_, 255});
  }

 private:
  std::vector<std::uint16_t> row_;
  const std::function<void(const PictureRow&)>& take_;
};

}  // namespace

bool is_webp(std::span<const unsigned char> bytes) {
  return bytes.size() > 12 && std::memcmp(bytes.data(), "RIFF", 4) == 0 &&
         std::memcmp(bytes.data() + 8, "WEBP", 4) == 0;
}

PictureSize checked_picture_size(std::span<const unsigned char> bytes, const std::string& where) {
  const box::Reading reading(where);
  const bool is_png = begins_with(bytes, png_signature);
  if (!is_png && !begins_with(bytes, jpeg_signature) && !is_webp(bytes))
    throw Error(where + ": is neither PNG, JPEG nor WebP; export it as PNG or JPEG");
  const auto [width, height] = is_webp(bytes) ? webp_size(bytes, where)
                               : is_png       ? PngReader(bytes, where).size()
                                              : jpeg_size(bytes, where);
  if (width > max_texture_side || height > max_texture_side)
    throw Error(where + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                "; a side is at most " + std::to_string(max_texture_side));
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const bool is_small = is_webp(bytes) && texels <= most_texels_of_few_bytes;
  if (!is_small && texels / max_texels_a_byte > bytes.size()) throw Error(where + ": is cut short");
  return {width, height};
}

void decode_rows(std::span<const unsigned char> bytes, PictureSize size, const std::string& where,
                 const std::function<void(const PictureRow&)>& take) {
  const box::Reading reading(where);
  RowTaker taker(size.width, take);
  const auto rgba = [&](const auto* samples) { taker.rgba(samples); };
  if (begins_with(bytes, png_signature)) {
    PngReader png(bytes, where);
    if (png.has_16_bits()) return png.read<std::uint16_t>(rgba);
    return png.read<std::uint8_t>(rgba);
  }
  if (!is_webp(bytes)) {
    const auto wrong = convert::decode_jpeg_rows(
        bytes, size.width, size.height,
        [&](std::span<const std::uint8_t> samples) { taker.rgb(samples); });
    if (wrong) refuse_damaged(where, "it " + *wrong);
    return;
  }
  int width = 0, height = 0;
  const std::unique_ptr<std::uint8_t, void (*)(void*)> webp(
      WebPDecodeRGBA(bytes.data(), bytes.size(), &width, &height), WebPFree);
  if (!webp || PictureSize{width, height} != size) refuse_damaged(where, "it is a damaged WebP");
  for (int y = 0; y < height; ++y)
    rgba(webp.get() +
         std::size_t{4} * static_cast<std::size_t>(y) * static_cast<std::size_t>(width));
}

std::vector<std::uint8_t> decoded_luma(std::span<const unsigned char> bytes, PictureSize size,
                                       const std::string& where) {
  std::vector<std::uint8_t> luma;
  luma.reserve(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
  decode_rows(bytes, size, where, [&](const PictureRow& row) {
    const int one = (row.largest + 1) / 256;  // of 16 bits, the upper 8 count
    for (std::size_t i = 0; i < row.rgba.size(); i += 4) {
      const int r = row.rgba[i] / one, g = row.rgba[i + 1] / one, b = row.rgba[i + 2] / one;
      luma.push_back(static_cast<std::uint8_t>((77 * r + 150 * g + 29 * b) >> 8));
    }
  });
  return luma;
}

}  // namespace previz::scene
