// How far one pose is from another, and how likely that is.
#pragma once

#include <opencv2/core.hpp>

#include "tests/support/test.hpp"

namespace previz::tracking {

using PoseError = cv::Vec<double, 6>;  // rotation (rad), then translation (m), in a pose's frame

// Returns the small motion d with to = from * d.
inline PoseError error_between(const glm::dmat4& from, const glm::dmat4& to) {
  const glm::dmat4 d = glm::inverse(from) * to;
  return {(d[1][2] - d[2][1]) / 2,
          (d[2][0] - d[0][2]) / 2,
          (d[0][1] - d[1][0]) / 2,
          d[3][0],
          d[3][1],
          d[3][2]};
}

// Returns the square of the error in its standard deviations, by a 6x6 covariance: 6 on average.
inline double square_in_sigmas(const std::array<double, 36>& covariance, const glm::dmat4& from,
                               const glm::dmat4& to) {
  const PoseError error = error_between(from, to);
  return error.dot(cv::Matx<double, 6, 6>(covariance.data()).solve(error, cv::DECOMP_SVD));
}

}  // namespace previz::tracking
