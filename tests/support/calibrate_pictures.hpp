// Makes the calibrate::Views that a camera would have of a board, for the tests of the
// calibrations.
#pragma once

#include <functional>
#include <optional>
#include <random>

#include "daemon/calibrate/lens/views.hpp"
#include "daemon/tracking/joint_pose.hpp"
#include "tests/support/units.hpp"

namespace previz::test {

using Lens = std::function<std::optional<glm::dvec2>(const glm::dvec3& point)>;

// The pose of a board before the camera: turned about the picture's vertical and horizontal axis
// and about the line of sight, with its middle at `middle` (camera axes, metres).
struct Held {
  double turn_deg = 0, tip_deg = 0, roll_deg = 0;
  glm::dvec3 middle{0, 0, 1};
};

// Returns one view for each Held. Corners have Gaussian noise; corners outside the picture are left
// out.
calibrate::Views hold(const calibrate::Board& board, const std::vector<Held>& how, const Lens& lens,
                      int width, int height, double noise_px, std::mt19937& random);

// A capture that a careful operator would make of a 9x6 board of 25 mm for a lens of about 60
// degrees: near and tilted all over the picture.
std::vector<Held> careful_capture();

}  // namespace previz::test
