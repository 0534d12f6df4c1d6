// Finds the edges at which a body of triangles looks different on either side: where its surface
// ends, and where it folds.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

namespace previz::fit {

inline constexpr std::size_t no_part = std::numeric_limits<std::size_t>::max();

// A straight edge. The faces that meet there lead away from it, across it, in the directions of
// `into`, of length 1: one where the surface ends, otherwise two or more.
struct FeatureEdge {
  glm::dvec3 a{0}, b{0};
  std::vector<glm::dvec3> into;
  // The part whose triangles meet there; no_part where those of several do.
  std::size_t part = no_part;
};

// Triangles are three corners each, metres; the way round does not matter. Corners within 0.02 mm
// are one. Faces that meet at more than 30 degrees make an edge, and edges in one line, within a
// degree, are joined, if they are of one part. `parts` has the number of the part that each
// triangle is a part of; nothing: they are of none.
std::vector<FeatureEdge> feature_edges(const std::vector<glm::dvec3>& triangles,
                                       const std::vector<std::size_t>& parts = {});

}  // namespace previz::fit
