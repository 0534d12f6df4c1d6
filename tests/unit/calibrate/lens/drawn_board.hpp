// Photographs of boards that tests have drawn.
#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "daemon/core/tracking/photometry.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::test {

inline Frame frame_of(const cv::Mat1b& picture) {
  return gray_frame(picture.cols, picture.rows, {picture.datastart, picture.dataend});
}

// Returns the drawing as a camera with the sRGB curve sees it: `map` takes its pixels into the
// picture; 4x4 samples per pixel, the light slightly blurred, noise of 1.5 of 255.
inline Frame photograph(const cv::Mat1b& drawing, const cv::Matx33d& map, cv::Size size,
                        cv::RNG& random) {
  const cv::Matx33d finer(4, 0, 1.5, 0, 4, 1.5, 0, 0, 1);
  cv::Mat1b fine, picture;
  cv::warpPerspective(drawing, fine, finer * map, size * 4, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                      200);
  cv::resize(fine, picture, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::Mat1b curve(1, 256);
  for (int i = 0; i < 256; ++i)
    curve(i) = std::uint8_t(std::lround(255 * tracking::srgb_encode(i / 255.0)));
  cv::LUT(picture, curve, picture);
  cv::Mat noisy(size, CV_16S);
  random.fill(noisy, cv::RNG::NORMAL, 0, 1.5);
  cv::add(picture, noisy, picture, {}, CV_8U);
  return frame_of(picture);
}

}  // namespace previz::test
