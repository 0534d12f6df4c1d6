#include "drivers/convert/yuv.hpp"

namespace previz::convert {

// BT.709-6 items 3.2 to 3.4 and BT.601-7 items 2.5.1 to 2.5.4, inverted:
// R' = Y' + 2(1-kr) Cr, B' = Y' + 2(1-kb) Cb, G' = (Y' - kr R' - kb B') / kg.
YuvToRgb::YuvToRgb(YuvMatrix matrix, YuvRange range) {
  const double kr = matrix == YuvMatrix::bt709 ? 0.2126 : 0.299;
  const double kb = matrix == YuvMatrix::bt709 ? 0.0722 : 0.114;
  const double kg = 1.0 - kr - kb;
  const bool limited = range == YuvRange::limited;
  const double black = limited ? 16.0 : 0.0;
  const double luma_gain = 255.0 / (limited ? 219.0 : 255.0);
  const double chroma_gain = 255.0 / (limited ? 224.0 : 255.0);
  for (std::size_t i = 0; i < luma_.size(); ++i)
    luma_[i] = static_cast<float>(luma_gain * (static_cast<double>(i) - black));
  for (std::size_t i = 0; i < chroma_codes; ++i) {
    const double chroma = chroma_gain * (static_cast<double>(i) / 8.0 - 128.0);
    red_of_cr_[i] = static_cast<float>(2.0 * (1.0 - kr) * chroma);
    blue_of_cb_[i] = static_cast<float>(2.0 * (1.0 - kb) * chroma);
    green_of_cr_[i] = static_cast<float>(-kr / kg * 2.0 * (1.0 - kr) * chroma);
    green_of_cb_[i] = static_cast<float>(-kb / kg * 2.0 * (1.0 - kb) * chroma);
  }
}

std::vector<float> YuvToRgb::terms() const {
  std::vector<float> result(luma_.begin(), luma_.end());
  for (const ChromaTable* table : {&red_of_cr_, &green_of_cb_, &green_of_cr_, &blue_of_cb_})
    result.insert(result.end(), table->begin(), table->end());
  return result;
}

}  // namespace previz::convert
