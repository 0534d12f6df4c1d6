#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "drivers/convert/convert.hpp"

namespace previz::convert {
namespace {

// OpenCV names a mosaic by the two samples in its second row, second and third column; the
// constants with four letters, as here, name the first two rows.
int edge_aware_code(BayerPattern pattern) {
  switch (pattern) {
    case BayerPattern::rggb:
      return cv::COLOR_BayerRGGB2RGB_EA;
    case BayerPattern::grbg:
      return cv::COLOR_BayerGRBG2RGB_EA;
    case BayerPattern::gbrg:
      return cv::COLOR_BayerGBRG2RGB_EA;
    case BayerPattern::bggr:
      return cv::COLOR_BayerBGGR2RGB_EA;
    default:
      throw std::invalid_argument("no Bayer mosaic");
  }
}

}  // namespace

// OpenCV copies the outermost pixels from those inside. The mosaic is therefore mirrored about its
// edge pixels by two, which keeps its pattern, and what OpenCV makes up is cut off again.
std::vector<std::uint8_t> demosaic(BayerPattern pattern, bool deep, int width, int height,
                                   std::span<const std::uint8_t> mosaic) {
  constexpr int margin = 2;
  // OpenCV only reads this picture, but has no type for that.
  const cv::Mat samples(height, width, deep ? CV_16UC1 : CV_8UC1,
                        const_cast<std::uint8_t*>(mosaic.data()));
  cv::Mat padded, colour;
  cv::copyMakeBorder(samples, padded, margin, margin, margin, margin, cv::BORDER_REFLECT_101);
  cv::demosaicing(padded, colour, edge_aware_code(pattern));
  std::vector<std::uint8_t> rgb(static_cast<std::size_t>(width) * height * (deep ? 6 : 3));
  cv::Mat out(height, width, deep ? CV_16UC3 : CV_8UC3, rgb.data());
  colour(cv::Rect(margin, margin, width, height)).copyTo(out);
  return rgb;
}

}  // namespace previz::convert
