// How exact a traced hit can be: fp64 geometry and error bounds of a single-precision
// ray/triangle test, for tests.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "daemon/core/scene/scene.hpp"
#include "tests/bench/tracers/gpu_tracer.hpp"

namespace previz::test {

// A ray and a triangle in fp64. Bounds follow from rounding: every coordinate relative to the ray's
// origin is wrong by at most `c` half ulps of the largest coordinate L involved. Across the ray
// that moves a weight by c eps L perimeter / (2 area of the projected triangle), and t along the
// ray by c eps L / |d| and the weights' error times the triangle's extent in t.
struct ExactHit {
  bool proper = false;  // the triangle is not seen exactly from its edge
  double t = 0;
  std::array<double, 3> weights{};
  double weight_error = 0;
  double t_error = 0;

  double least_weight() const;
  bool surely() const { return proper && least_weight() > weight_error; }
  bool possibly() const { return !proper || least_weight() > -weight_error; }
};

// Intersects the ray with a primitive of an instance, whose corners are never rounded.
ExactHit exact_hit(const scene::Scene& scene, std::uint32_t instance, std::uint32_t primitive,
                   const bench::Ray& ray);

// Returns whether hits `a` and `b` of one ray can both come from correct tracers: t is the same
// within their errors, or one hit is so near its triangle's edge (or the ray's ends) that the other
// tracer may miss it.
bool agree(const scene::Scene& scene, const bench::Ray& ray, const bench::TracedHit& a,
           const bench::TracedHit& b);

}  // namespace previz::test
