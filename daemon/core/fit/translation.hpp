// Finds the translation in the world by which a part would have to be moved to lie on its edges of
// light.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/fit/shift.hpp"

namespace previz::fit {

// Returns how a translation of the part, metres in the world, shifts a piece in its picture, px.
glm::dvec2 shift_by(const EdgeSample& piece, const glm::dvec3& translation_m);

// Returns the translation on which most pieces of one part agree, which may be from several frames;
// the shorter of two that are alike. It is at most about reach_px long in the pictures.
glm::dvec3 agreed_translation(const std::vector<EdgeSample>& pieces);

}  // namespace previz::fit
