#include "daemon/core/pipeline/preview_size.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "daemon/core/render/picture/each_pixel.hpp"

namespace previz::pipeline {

namespace {

int scaled_side(int full, double scale) {
  assert(scale > 0 && scale <= 1);
  return std::max(1, static_cast<int>(std::lround(scale * full)));
}

}  // namespace

ObserverCalibration scaled(ObserverCalibration calibration, double scale) {
  PinholeIntrinsics& lens = calibration.intrinsics;
  const int width = scaled_side(lens.width, scale), height = scaled_side(lens.height, scale);
  const double x = static_cast<double>(width) / lens.width;
  const double y = static_cast<double>(height) / lens.height;
  lens.width = width;
  lens.height = height;
  lens.fx *= x;
  lens.fy *= y;
  lens.cx = x * lens.cx + 0.5 * (x - 1);
  lens.cy = y * lens.cy + 0.5 * (y - 1);
  return calibration;
}

Plate scaled(const Plate& plate, double scale, const lighting::Response& response) {
  assert(response.bits() == plate.bits);
  const int width = scaled_side(plate.width, scale), height = scaled_side(plate.height, scale);
  const std::vector<double>& inverse = response.inverse();
  cv::Mat3d full(plate.height, plate.width);
  render::each_pixel(full.total(), [&](std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c)
      full.ptr<double>()[3 * i + c] = inverse[plate.samples[3 * i + c]];
  });
  cv::Mat3d small;
  cv::resize(full, small, {width, height}, 0, 0, cv::INTER_AREA);
  Plate result{width, height, plate.bits, std::vector<std::uint16_t>(3 * small.total())};
  render::each_pixel(small.total(), [&](std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c)
      result.samples[3 * i + c] = response.forward(small.ptr<double>()[3 * i + c]);
  });
  return result;
}

}  // namespace previz::pipeline
