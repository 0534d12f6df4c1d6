// The equal-area octahedral map between the square [-1,1]^2 and the sphere (Clarberg 2008, "Fast
// Equal-Area Mapping of the (Hemi)Sphere using SIMD"). Both the shaders and C++ (by GLM) compile
// this file.
#ifndef PREVIZ_OCTAHEDRAL_H
#define PREVIZ_OCTAHEDRAL_H

#ifdef __cplusplus
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#define PREVIZ_INLINE inline
namespace previz {
using glm::abs;
using glm::atan;
using glm::sqrt;
using glm::vec2;
using glm::vec3;
#else
#define PREVIZ_INLINE
#endif

// Returns the sine of t quarter turns, 0 <= t <= 1, with a relative error below 6e-9 (Hastings 1955,
// "Approximations for Digital Computers", sheet 16). Vulkan lets a driver's sine be off by 2^-11, the
// sixth part of a texel of a map with 1024 texels on a side.
PREVIZ_INLINE float sine_of_quarter_turns(float t) {
  const float s = t * t;
  const float tail = -0.64596371106f + s * (0.07968967928f + s * (-0.00467376557f + s * 0.00015148419f));
  return t * (1.57079631847f + s * tail);
}

// Maps a point of the square to a unit direction; the centre is +Z, the corners are -Z.
PREVIZ_INLINE vec3 octahedral_direction(vec2 p) {
  const float u = abs(p.x);
  const float v = abs(p.y);
  const float distance = 1.0f - u - v;  // > 0 in the upper hemisphere
  const float r = 1.0f - abs(distance);
  const float turn = r == 0.0f ? 0.0f : (v - u) / r;  // from -1 on the x axis to 1 on the y axis
  const float sin_theta_over_r = sqrt(2.0f - r * r);
  const float x = sine_of_quarter_turns(0.5f - 0.5f * turn) * r * sin_theta_over_r;
  const float y = sine_of_quarter_turns(0.5f + 0.5f * turn) * r * sin_theta_over_r;
  const float z = 1.0f - r * r;
  return vec3(p.x < 0.0f ? -x : x, p.y < 0.0f ? -y : y, distance < 0.0f ? -z : z);
}

// Maps a unit direction to its point of the square; it is the inverse of octahedral_direction().
PREVIZ_INLINE vec2 octahedral_point(vec3 d) {
  const float x = abs(d.x);
  const float y = abs(d.y);
  const float z = abs(d.z);
  // r is sqrt(1 - z), written so that nothing cancels near the poles.
  const float r = sqrt((x * x + y * y) / (1.0f + z));
  const float phi = x == 0.0f && y == 0.0f ? 0.0f : atan(y, x) * 0.63661977237f;  // [0, 1]
  float v = phi * r;
  float u = r - v;
  if (d.z < 0.0f) {
    const float swap = u;
    u = 1.0f - v;
    v = 1.0f - swap;
  }
  return vec2(d.x < 0.0f ? -u : u, d.y < 0.0f ? -v : v);
}

#ifdef __cplusplus
}  // namespace previz
#endif
#undef PREVIZ_INLINE
#endif
