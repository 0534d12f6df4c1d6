// Finds the edges at which a body of triangles looks different on either side: where its surface
// ends, and where it folds.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

namespace previz::fit {

// A straight edge. The faces that meet there lead away from it, across it, in the directions of
// `into`, of length 1: one where the surface ends, otherwise two or more.
struct FeatureEdge {
  glm::dvec3 a{0}, b{0};
  std::vector<glm::dvec3> into;
};

// Triangles are three corners each, metres; the way round does not matter. Corners within 0.02 mm
// are one. Faces that meet at more than 30 degrees make an edge, and edges in one line, within a
// degree, are joined.
std::vector<FeatureEdge> feature_edges(const std::vector<glm::dvec3>& triangles);

}  // namespace previz::fit
