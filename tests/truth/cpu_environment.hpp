// The environment map in double precision: lookup, importance sampling and its density.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/lighting/environment.hpp"

namespace previz::truth {

// shaders/lib/octahedral.h's mapping, in double.
glm::dvec3 octahedral_direction_fp64(glm::dvec2 point);
glm::dvec2 octahedral_point_fp64(glm::dvec3 direction);

struct DirectionSample {
  glm::dvec3 direction{0, 0, 1};
  double pdf = 0;  // per steradian
};

// Bilinear between texel centres, wrapped over the square's edges by the octahedral rule. An empty
// map is black.
class Environment {
 public:
  explicit Environment(const lighting::EnvironmentMap& map);

  bool black() const { return cumulative_.empty(); }
  glm::dvec3 radiance(const glm::dvec3& direction) const;
  // Density proportional to the mean luminance of a texel's 3x3 neighbourhood, which is positive
  // wherever the interpolated radiance is.
  DirectionSample sample(glm::dvec2 random) const;
  double pdf(const glm::dvec3& direction) const;

 private:
  glm::dvec3 texel(int i, int j) const;

  int size_ = 0;
  std::vector<glm::vec3> radiance_;
  std::vector<double> cumulative_;  // over texels, ends at 1; empty: black
};

}  // namespace previz::truth
