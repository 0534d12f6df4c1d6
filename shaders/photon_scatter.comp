// Writes every stored photon into the range of its bucket, in no particular order.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

void main() {
  const uint photon = gl_GlobalInvocationID.x;
  if (photon >= 2u * frame.photon_count || photons[photon].vertices == 0u) return;
  const uint bucket = photon_bucket(photons[photon].position);
  photon_order[buckets[bucket].first + atomicAdd(filled[bucket], 1u)] = photon;
}
