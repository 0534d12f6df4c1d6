// Finds the way in the world by which a thing would have to be moved to lie on its edges of light.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/fit/shift.hpp"

namespace previz::fit {

// Returns how a way of the thing, metres in the world, shifts a piece in its picture, px.
glm::dvec2 shift_by(const Looked& piece, const glm::dvec3& way_m);

// Returns the way on which most pieces of one thing agree, which may be from several frames; the
// shorter of two that are alike. It is at most about reach_px long in the pictures.
glm::dvec3 agreed_way(const std::vector<Looked>& pieces);

}  // namespace previz::fit
