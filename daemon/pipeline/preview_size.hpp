// The observer at a fraction of its size (quality.scale): what a preview renders and shows.
#pragma once

#include "daemon/lighting/response.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::pipeline {

// The same lens seen by fewer, larger pixels: sides are rounded to nearest and at least 1, and the
// picture keeps its edges, so a point at pixel u comes to (u + 0.5) width'/width - 0.5. `scale` is
// above 0 and at most 1; 1 changes nothing.
ObserverCalibration scaled(ObserverCalibration calibration, double scale);

// The plate at the same size: each pixel the mean, in linear light, of the area it covers.
// `response` is of the plate's bits.
Plate scaled(const Plate& plate, double scale, const lighting::Response& response);

}  // namespace previz::pipeline
