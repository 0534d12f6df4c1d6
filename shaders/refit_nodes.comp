// Makes the boxes of one level of nodes anew from those of their children, in the words that
// lib/shared.h describes. It is dispatched level by level, the deepest first.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/refit.glsl"

layout(scalar) readonly buffer RefitNodes { uint refit_nodes[]; };

// Planes are rounded outwards in integers: coordinates are below 2^23, so that floor and ceil are
// exact, and the floor of a quotient is that of the floor.
ivec3 whole_below(vec3 v) { return ivec3(floor(v)); }
ivec3 whole_above(vec3 v) { return ivec3(ceil(v)); }

// Returns the least exponent with which an extent has at most 255 steps.
int cell_exponent(int extent) {
  int exponent = extent > 255 ? findMSB(extent) - 7 : 0;
  if (((extent + (1 << exponent) - 1) >> exponent) > 255) ++exponent;
  return exponent;
}

void main() {
  if (gl_GlobalInvocationID.x >= refit.count) return;
  const uint record = refit_nodes[refit.first + gl_GlobalInvocationID.x];
  const uint texel = first_texel(record);
  const uint block = bvh_texels[texel].w;
  vec3 low = vec3(3.4e38);
  vec3 high = vec3(-3.4e38);
  float cost = 0.0;
  uint there = 0u;  // a bit for each child
  for (uint slot = 0u; slot < 8u; ++slot) {
    const uint child = 8u * block + slot;
    if ((bvh_texels[first_texel(child)].z & 0xffu) == RECORD_NOTHING) continue;
    const GpuRefitBox box = refit_boxes[refit.first_box + child];
    low = min(low, box.low);
    high = max(high, box.high);
    cost += box.cost;
    there |= 1u << slot;
  }
  const ivec3 origin = whole_below(low);
  const ivec3 extent = whole_above(high) - origin;
  const ivec3 exponent =
      ivec3(cell_exponent(extent.x), cell_exponent(extent.y), cell_exponent(extent.z));
  // Each axis has the low planes of children 0..3 and 4..7, then the high ones.
  uvec4 planes[3] = uvec4[3](uvec4(0u), uvec4(0u), uvec4(0u));
  for (uint slot = 0u; slot < 8u; ++slot) {
    ivec3 first = ivec3(255);  // the box of an empty slot is inverted
    ivec3 last = ivec3(0);
    if ((there & (1u << slot)) != 0u) {
      const GpuRefitBox box = refit_boxes[refit.first_box + 8u * block + slot];
      // The bounds of a plane hold for all numbers; others would spill into the planes beside it.
      first = clamp((whole_below(box.low) - origin) >> exponent, 0, 255);
      last = clamp((whole_above(box.high) - origin + (ivec3(1) << exponent) - 1) >> exponent, 0, 255);
    }
    const uint shift = 8u * (slot & 3u);
    for (int axis = 0; axis < 3; ++axis) {
      planes[axis][slot >> 2] |= uint(first[axis]) << shift;
      planes[axis][2u + (slot >> 2)] |= uint(last[axis]) << shift;
    }
  }
  bvh_texels[texel].xyz = (uvec3(origin) << 8) | (uvec3(exponent) + RECORD_NODE);
  for (int axis = 0; axis < 3; ++axis) bvh_texels[texel + 1u + uint(axis)] = planes[axis];
  refit_boxes[refit.first_box + record] = GpuRefitBox(low, cost + half_area(low, high), high);
}
