// Converts Y'CbCr to R'G'B' by the equations of the ITU-R Recommendations.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace previz::convert {

enum class YuvMatrix { bt601, bt709 };  // Rec. ITU-R BT.601-7, BT.709-6
enum class YuvRange { limited, full };  // 8-bit luma 16..235 and chroma 16..240, or all of 0..255

// Holds the tables for one coding: 8-bit in, 8-bit out, rounded to nearest, clipped to 0..255.
class YuvToRgb {
 public:
  YuvToRgb(YuvMatrix matrix, YuvRange range);

  // Takes chroma in eighths of a code (0..2040), so that interpolated chroma keeps its fraction.
  void operator()(int y, int cb_eighths, int cr_eighths, std::uint8_t* rgb) const {
    const float luma = luma_[static_cast<std::size_t>(y)];
    const auto cb = static_cast<std::size_t>(cb_eighths), cr = static_cast<std::size_t>(cr_eighths);
    rgb[0] = to_code(luma + red_of_cr_[cr]);
    rgb[1] = to_code(luma + green_of_cb_[cb] + green_of_cr_[cr]);
    rgb[2] = to_code(luma + blue_of_cb_[cb]);
  }

  static constexpr std::size_t luma_codes = 256, chroma_codes = 8 * 255 + 1;
  // Returns the tables for a graphics card that does the same: what is added up in codes, of the
  // luma_codes of luma, then of the chroma_codes of Cr for red, of Cb and of Cr for green, and of
  // Cb for blue.
  std::vector<float> terms() const;

 private:
  using ChromaTable = std::array<float, chroma_codes>;

  static std::uint8_t to_code(float value) {
    if (value <= 0) return 0;
    const float half_up = value + 0.5f;  // runs three times a pixel: std::lround would be a call
    return value >= 255 ? 255 : static_cast<std::uint8_t>(half_up);
  }

  std::array<float, luma_codes> luma_{};  // R' = G' = B' of grey, in codes 0..255
  ChromaTable red_of_cr_{}, green_of_cb_{}, green_of_cr_{}, blue_of_cb_{};
};

}  // namespace previz::convert
