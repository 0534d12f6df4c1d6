// Applies the pinhole lens with Brown-Conrady distortion, both ways and with its derivative.
#pragma once

#include <glm/mat2x2.hpp>
#include <glm/vec2.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz {

// Maps the normalised image plane (x/z, y/z) to pixels, as cv::projectPoints does. `jacobian`, if
// given, becomes d(pixel)/d(normalised), column-major as in glm.
glm::dvec2 distort(const PinholeIntrinsics& lens, glm::dvec2 normalised,
                   glm::dmat2* jacobian = nullptr);

// Maps pixels to the normalised image plane, to 1e-9 px by Newton's method. Returns nothing where
// the polynomial has no inverse (beyond the radius at which it turns back).
std::optional<glm::dvec2> undistort(const PinholeIntrinsics& lens, glm::dvec2 pixel);

}  // namespace previz
