// Reads a picture's linear signals, for measurements on a camera's sensor.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::calibrate {

struct SignalPicture {
  int width = 0, height = 0;
  std::vector<glm::dvec3> signal;  // row-major; 0 to 1, by the inverse response
};

SignalPicture read_signals(const FramePtr& frame, const ResponseCurve& response);

}  // namespace previz::calibrate
