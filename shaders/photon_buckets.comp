// Assigns each bucket its range of the order.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

void main() {
  const uint bucket = gl_GlobalInvocationID.x;
  if (bucket >= photon_bucket_count()) return;
  const uint count = buckets[bucket].count;
  if (count > 0u) buckets[bucket].first = atomicAdd(photon_control.stored, count);
}
