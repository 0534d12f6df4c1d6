// Puts the new vertices of a mesh that deforms into the leaves of its tree.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/refit.glsl"

PREVIZ_FETCHED(vec4, vertices)  // see lib/scene.glsl
layout(scalar) readonly buffer RefitLeaves { GpuRefitLeaf refit_leaves[]; };

// Returns a vertex in grid space; the scale is a power of two, so it is exact.
vec3 grid_vertex(uint vertex) {
  return fetch(vertices, int(2u * (refit.first_vertex + vertex))).xyz * refit.scale;
}

void main() {
  if (gl_GlobalInvocationID.x >= refit.count) return;
  const GpuRefitLeaf leaf = refit_leaves[refit.first + gl_GlobalInvocationID.x];
  const vec3 v0 = grid_vertex(leaf.vertices.x);
  const vec3 v1 = grid_vertex(leaf.vertices.y);
  const vec3 v2 = grid_vertex(leaf.vertices.z);
  const vec3 v3 = grid_vertex(leaf.vertices.w);
  const uint texel = first_texel(leaf.record);
  bvh_texels[texel + 1u] = floatBitsToUint(vec4(v0, v1.x));
  bvh_texels[texel + 2u] = floatBitsToUint(vec4(v1.yz, v2.xy));
  bvh_texels[texel + 3u] = floatBitsToUint(vec4(v2.z, v3));
  const vec3 low = min(min(v0, v1), min(v2, v3));
  const vec3 high = max(max(v0, v1), max(v2, v3));
  refit_boxes[refit.first_box + leaf.record] = GpuRefitBox(low, half_area(low, high), high);
}
