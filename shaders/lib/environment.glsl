// The environment: its radiance in a direction, and sampling of directions by importance. Samples
// are warped down a quadtree of densities (Clarberg et al. 2005, "Wavelet Importance Sampling").
#ifndef PREVIZ_ENVIRONMENT_GLSL
#define PREVIZ_ENVIRONMENT_GLSL

#include "shaders/lib/octahedral.h"
#include "shaders/lib/scene.glsl"

// (size + 2)^2: the map with a border that is wrapped by the octahedral rule, and the density of a texel
// per steradian.
PREVIZ_FETCHED(vec4, environment)
// A quadtree of sampling density: level l has 4^l texels, each with the densities of its
// four children; the mean density is 1 on every level.
PREVIZ_FETCHED(vec4, importance)

// Interpolates bilinearly between texel centres; a border of one texel holds what lies over the
// edge. `pdf` is the density of environment_sample() in this direction, which is that of the nearest texel.
vec3 environment_radiance(vec3 direction, out float pdf) {
  const int size = int(frame.environment_size);
  const int stride = size + 2;
  const vec2 at = (octahedral_point(direction) * 0.5 + 0.5) * float(size) + 0.5;
  const vec2 low = clamp(floor(at), vec2(0.0), vec2(float(size)));
  const vec2 f = at - low;
  const int first = int(low.y) * stride + int(low.x);
  const vec4 top_left = fetch(environment, first), top_right = fetch(environment, first + 1);
  const vec4 left = fetch(environment, first + stride), right = fetch(environment, first + stride + 1);
  const bool is_right = f.x >= 0.5;
  pdf = f.y >= 0.5 ? (is_right ? right.w : left.w) : (is_right ? top_right.w : top_left.w);
  return mix(mix(top_left.rgb, top_right.rgb, f.x), mix(left.rgb, right.rgb, f.x), f.y);
}

vec3 environment_radiance(vec3 direction) {
  float pdf;
  return environment_radiance(direction, pdf);
}

// Returns the texel of IMPORTANCE that holds the densities of the four children of a node.
int importance_texel(uint level, uvec2 at) {
  // (4^level - 1) / 3 texels precede this level.
  return int(((1u << (2u * level)) - 1u) / 3u + (at.y << level) + at.x);
}

// Picks the lower (false) or upper (true) half by the weights, and stretches the rest of u to [0,
// 1).
bool pick_half(float lower, float upper, inout float u) {
  const float p = lower / (lower + upper);
  const bool second = u >= p;
  u = second ? (u - p) / (1.0 - p) : u / p;
  u = min(u, 0.99999994);
  return second;
}

// Returns a direction, and in `pdf` its density per steradian.
vec3 environment_sample(vec2 u, out float pdf) {
  uvec2 texel = uvec2(0u);
  float density = 1.0;
  for (uint level = 0u; level < frame.environment_levels; ++level) {
    const vec4 c = fetch(importance, importance_texel(level, texel));
    const bool right = pick_half(c.x + c.z, c.y + c.w, u.x);
    const bool down = pick_half(right ? c.y : c.x, right ? c.w : c.z, u.y);
    texel = texel * 2u + uvec2(right, down);
    density = c[uint(right) + 2u * uint(down)];
  }
  pdf = density / (4.0 * PI);
  return octahedral_direction((vec2(texel) + u) / float(frame.environment_size) * 2.0 - 1.0);
}

#endif
