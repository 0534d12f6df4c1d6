// Converts OpenCV's poses to ours.
#pragma once

#include <opencv2/calib3d.hpp>

#include "daemon/core/tracking/joint_pose.hpp"

namespace previz::calibrate {

// Converts cv::solvePnP's rotation vector and translation.
inline tracking::CameraFromWorld from_opencv(const cv::Mat& turn, const cv::Mat& shift) {
  cv::Matx33d rotation;
  cv::Rodrigues(turn, rotation);
  tracking::CameraFromWorld pose;
  for (int row = 0; row < 3; ++row) {
    pose.translation[row] = shift.at<double>(row);
    for (int column = 0; column < 3; ++column) pose.rotation[column][row] = rotation(row, column);
  }
  return pose;
}

}  // namespace previz::calibrate
