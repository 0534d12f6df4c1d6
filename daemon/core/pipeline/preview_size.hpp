// Scales the observer's calibration and plates to the size that a preview renders (quality.scale).
#pragma once

#include "daemon/core/lighting/response.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::pipeline {

// Returns the calibration of the same lens with fewer, larger pixels. Sides are rounded to nearest
// and are at least 1. The picture keeps its edges, so a point at pixel u comes to (u + 0.5)
// width'/width - 0.5. `scale` is above 0 and at most 1; 1 changes nothing.
ObserverCalibration scaled(ObserverCalibration calibration, double scale);

// Returns the plate at that size; each pixel is the mean, in linear light, of the area that it
// covers. `response` must be for the plate's bit depth.
Plate scaled(const Plate& plate, double scale, const lighting::Response& response);

}  // namespace previz::pipeline
