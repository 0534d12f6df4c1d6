// The pinhole lens with Brown-Conrady distortion, both ways and with its derivative.
#pragma once

#include <glm/mat2x2.hpp>
#include <glm/vec2.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz {

// Normalised image plane (x/z, y/z) to pixels, as cv::projectPoints. `jacobian`, where given,
// becomes d(pixel)/d(normalised), column-major as glm has it.
glm::dvec2 distort(const PinholeIntrinsics& lens, glm::dvec2 normalised,
                   glm::dmat2* jacobian = nullptr);

// Pixels to the normalised image plane, to 1e-9 px by Newton's method. Nothing where the
// polynomial has no inverse there (beyond the radius at which it turns back).
std::optional<glm::dvec2> undistort(const PinholeIntrinsics& lens, glm::dvec2 pixel);

}  // namespace previz
