// Drawings of boards as a film camera with the sRGB curve sees them.
#pragma once

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/core/tracking/photometry.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::calibrate::drawn_board {

inline constexpr int width = 640, height = 480;
inline constexpr double focal_px = 620;

// Where a board is: turned by a rotation vector about the drawing's centre, which is at `middle`;
// the drawing's longer side is the unit.
struct Held {
  cv::Vec3d turn, middle;
};

inline cv::Matx33d pixel_from_drawing(const cv::Size& drawing, const Held& held) {
  cv::Matx33d r;
  cv::Rodrigues(held.turn, r);
  const cv::Vec3d& t = held.middle;
  const cv::Matx33d pose(r(0, 0), r(0, 1), t[0], r(1, 0), r(1, 1), t[1], r(2, 0), r(2, 1), t[2]);
  const double s = 1.0 / std::max(drawing.width, drawing.height);
  const cv::Matx33d centred(s, 0, -0.5 * s * (drawing.width - 1), 0, s,
                            -0.5 * s * (drawing.height - 1), 0, 0, 1);
  return cv::Matx33d(focal_px, 0, 319.5, 0, focal_px, 239.5, 0, 0, 1) * pose * centred;
}

inline Frame frame_of(const cv::Mat1b& picture) {
  return test::gray_frame(picture.cols, picture.rows, {picture.datastart, picture.dataend});
}

// 4x4 samples per pixel, the light slightly blurred, noise of 1.5 of 255.
inline Frame photograph(const cv::Mat1b& drawing, const Held& held, cv::RNG& random) {
  const cv::Matx33d finer(4, 0, 1.5, 0, 4, 1.5, 0, 0, 1);
  cv::Mat1b fine, picture;
  cv::warpPerspective(drawing, fine, finer * pixel_from_drawing(drawing.size(), held),
                      {4 * width, 4 * height}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 200);
  cv::resize(fine, picture, {width, height}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::Mat1b curve(1, 256);
  for (int i = 0; i < 256; ++i)
    curve(i) = std::uint8_t(std::lround(255 * tracking::srgb_encode(i / 255.0)));
  cv::LUT(picture, curve, picture);
  cv::Mat noisy(height, width, CV_16S);
  random.fill(noisy, cv::RNG::NORMAL, 0, 1.5);
  cv::add(picture, noisy, picture, {}, CV_8U);
  return frame_of(picture);
}

}  // namespace previz::calibrate::drawn_board
