// Applies the pinhole lens with its distortion, both ways and with its derivative.
#pragma once

#include <glm/mat2x2.hpp>
#include <glm/vec2.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz {

// Maps the normalised image plane (x/z, y/z) to pixels, as cv::projectPoints does with eight
// coefficients. `jacobian`, if given, becomes d(pixel)/d(normalised), column-major as in glm. Where
// the divisor of the radial function is 0, the result is not finite.
glm::dvec2 distort(const PinholeIntrinsics& lens, glm::dvec2 normalised,
                   glm::dmat2* jacobian = nullptr);

// Maps pixels to the normalised image plane, to 1e-9 px by Newton's method. Returns nothing where
// the lens has no inverse: where is_unfolded() is false of every point.
std::optional<glm::dvec2> undistort(const PinholeIntrinsics& lens, glm::dvec2 pixel);

// Returns whether a point that distort() maps to `pixel` is the one that the lens shows there,
// rather than one that the radial function, r (1 + k1 r^2 + ...) / (1 + k4 r^2 + ...), has folded
// back into the picture: that function grows from the axis to the point, and its divisor is above 0
// as far off the axis as the point and, without distortion, the pixel. False of numbers that are
// not finite.
bool is_unfolded(const PinholeIntrinsics& lens, glm::dvec2 normalised, glm::dvec2 pixel);

}  // namespace previz
