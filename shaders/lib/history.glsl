// What the passes of the history share: where things were in the frame before.
#ifndef PREVIZ_HISTORY_GLSL
#define PREVIZ_HISTORY_GLSL

#include "shaders/lib/lens.glsl"
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

// What a pixel shows at its middle, in 32 bits: the instance, 24 bits, NO_THING for none; the class, 2 bits:
// 1 for a virtual object, 0 for anything else, 2 for what lets light through; and 0, or for what is seen in a
// mirror or through glass a hash of that, 3 bits that are not 0, and one of the way on from there, 3 bits.
const uint NO_THING = 0xffffffu;
const uint SEE_THROUGH_CLASS = 2u;

uint pack_thing(uint instance, uint of_class, uint mirror) {
  return (instance & NO_THING) | (of_class << 24) | (mirror << 26);
}
uint instance_of(uint thing) { return thing & NO_THING; }
bool is_seen_in_mirror(uint thing) { return (thing >> 26) != 0u; }
bool are_same_mirror(uint a, uint b) { return ((a ^ b) >> 24 & 31u) == 0u; }
// Returns 0, 1 or COVER_SEE_THROUGH.
float class_of(uint thing) {
  const uint of_class = (thing >> 24) & 3u;
  return of_class == SEE_THROUGH_CLASS ? COVER_SEE_THROUGH : float(of_class);
}

// Returns the place of a point in the picture before, whose pixels' centres are at whole numbers. The point
// is relative to the camera of then, in the world's axes. What is behind it is at NOWHERE.
const float NOWHERE = 1e9;
vec2 project_before(vec3 position) {
  const vec3 camera = rotated(history.camera_from_world, position);
  if (camera.z <= 0.0) return vec2(NOWHERE);
  const vec2 bent = distorted(camera.xy / camera.z, history.radial, history.radial_divisor,
                              history.tangential);
  return history.focal_px * bent + history.principal_px;
}

// An albedo that is not known is kept as 0, and is then in the light.
bool is_known(vec3 albedo) { return all(greaterThan(albedo, vec3(0.0))); }

// Returns whether a pixel's own side and the other one are known apart. `side` is that of its middle,
// `cover` what history_cover.comp has found.
bool has_sides(float side, float cover) {
  return side != COVER_SEE_THROUGH && cover != COVER_SEE_THROUGH;
}

#endif
