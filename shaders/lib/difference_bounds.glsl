// Directions towards the objects that are in one world only. The worlds can differ only there, so a
// shared path spends a share of its directions on them (shaders/README.md, "Difference bounds").
// Each object is represented by its bounding sphere, which is seen under a cone from any point
// outside; a sphere that contains the point takes no part, since the BSDF meets it often enough.
#ifndef PREVIZ_DIFFERENCE_BOUNDS_GLSL
#define PREVIZ_DIFFERENCE_BOUNDS_GLSL

#include "shaders/lib/light.glsl"

// The centre and the radius of each object that is not in both worlds, then of each object that can
// reflect without blur.
PREVIZ_FETCHED(vec4, bounds)

// Returns 1 - cos of the half angle under which the bound is seen, or 0 from inside it.
float bound_cap(vec4 bound, vec3 point) {
  const vec3 to_center = bound.xyz - point;
  const float distance_squared = dot(to_center, to_center);
  return distance_squared > bound.w * bound.w ? sphere_cap(bound.w, distance_squared) : 0.0;
}

// Returns whether the segment from the point can meet any bound.
bool meets_bounds(vec3 point, vec3 direction, float t_max) {
  for (uint i = 0u; i < frame.bound_count; ++i) {
    const vec4 bound = fetch(bounds, int(i));
    const vec3 to_center = bound.xyz - point;
    const float nearest = clamp(dot(to_center, direction), 0.0, t_max);
    const vec3 off = to_center - nearest * direction;
    if (dot(off, off) <= bound.w * bound.w) return true;
  }
  return false;
}

// Returns the sum of all caps, by which bounds_sample() chooses a cone in proportion to its solid
// angle.
float bounds_total(vec3 point) {
  float total = 0.0;
  for (uint i = 0u; i < frame.bound_count; ++i) total += bound_cap(fetch(bounds, int(i)), point);
  return total;
}

// `total` is bounds_total(point), above 0.
vec3 bounds_sample(vec3 point, float total, vec2 u) {
  float rest = u.x * total;
  uint chosen = 0u;
  float cap = 0.0;
  for (uint i = 0u; i < frame.bound_count; ++i) {
    const float next = bound_cap(fetch(bounds, int(i)), point);
    if (next <= 0.0) continue;
    chosen = i;
    cap = next;
    rest -= next;
    if (rest < 0.0) break;
  }
  u.x = clamp(1.0 + rest / cap, 0.0, 0.99999994);
  return sample_cone(normalize(fetch(bounds, int(chosen)).xyz - point), cap, u);
}

// Returns the density of bounds_sample() per steradian: every cone that contains the direction adds
// its probability, cap / total, times its density, 1 / (2 pi cap).
float bounds_pdf(vec3 point, float total, vec3 direction) {
  if (total <= 0.0) return 0.0;
  float cones = 0.0;
  for (uint i = 0u; i < frame.bound_count; ++i) {
    const vec4 bound = fetch(bounds, int(i));
    const vec3 to_center = bound.xyz - point;
    const float along = dot(to_center, direction);
    const vec3 off = to_center - along * direction;
    const float radius_squared = bound.w * bound.w;
    if (dot(to_center, to_center) > radius_squared && along > 0.0 && dot(off, off) <= radius_squared)
      cones += 1.0;
  }
  return cones / (2.0 * PI * total);
}

#endif
