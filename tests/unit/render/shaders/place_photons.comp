// Stores photons as photon_bounce.comp does: a third of them in one place, a third along a short line,
// the others all around. Every fifth of all is not stored. Each has its index as its flux.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

vec3 place_of(uint photon) {
  const float along = unit_float(hash_bits(photon));
  if (photon % 3u == 0u) return vec3(0.0, 0.0, 1.0);
  if (photon % 3u == 1u) return vec3(0.1 * along, 0.0, 1.0);
  return vec3(along, unit_float(hash_bits(photon + 1u)), 0.5 + unit_float(hash_bits(photon + 2u)));
}

void main() {
  const uint photon = gl_GlobalInvocationID.x;
  if (photon >= 2u * frame.photon_count) return;
  photons[photon].vertices = min(photon % 5u, 1u);
  photons[photon].position = place_of(photon);
  photons[photon].mixed = vec3(float(photon));
  if (photon % 5u > 0u) atomicAdd(buckets[photon_bucket(place_of(photon))].count, 1u);
}
