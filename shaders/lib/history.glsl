// What the passes of the history share: where things were in the frame before.
#ifndef PREVIZ_HISTORY_GLSL
#define PREVIZ_HISTORY_GLSL

#include "shaders/lib/octahedral.h"
#include "shaders/lib/render_shared.h"

layout(scalar) readonly buffer History { GpuHistory history; };
layout(scalar) readonly buffer Motions { GpuMotion motions[]; };  // of the instances

vec3 rotated(vec4 rows[3], vec3 v) {
  return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}
vec3 moved(vec4 rows[3], vec3 p) {
  return rotated(rows, p) + vec3(rows[0].w, rows[1].w, rows[2].w);
}

// Two unit vectors in 32 bits, each to half a degree: the normals of the triangle and of the shading.
uint pack_normals(vec3 geometric, vec3 shading) {
  return packSnorm4x8(vec4(octahedral_point(geometric), octahedral_point(shading)));
}
vec3 geometric_of(uint bits) { return octahedral_direction(unpackSnorm4x8(bits).xy); }
vec3 shading_of(uint bits) { return octahedral_direction(unpackSnorm4x8(bits).zw); }

// An albedo that is not known is kept as 0, and is then in the light.
bool is_known(vec3 albedo) { return all(greaterThan(albedo, vec3(0.0))); }

// Returns whether a pixel's own side and the other one are known apart. `side` is that of its middle,
// `cover` what history_cover.comp has found.
bool has_sides(float side, float cover) {
  return side != COVER_SEE_THROUGH && cover != COVER_SEE_THROUGH;
}

#endif
