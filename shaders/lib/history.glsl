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

// A unit vector in 32 bits.
uint pack_unit(vec3 v) { return packSnorm2x16(octahedral_point(v)); }
vec3 unpack_unit(uint bits) { return octahedral_direction(unpackSnorm2x16(bits)); }

#endif
