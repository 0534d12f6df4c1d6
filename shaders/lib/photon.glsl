// The photons of a pass, and the hash grid in which they are found. A cell is twice as wide as the
// radius, so that a disc of photons touches at most two cells an axis.
#ifndef PREVIZ_PHOTON_GLSL
#define PREVIZ_PHOTON_GLSL

#include "shaders/lib/batch.glsl"
#include "shaders/lib/sampler.glsl"

layout(scalar, set = 2, binding = BINDING_PHOTONS) buffer Photons { GpuPhoton photons[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_ORDER) buffer Order { uint photon_order[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_BUCKETS) buffer Buckets {
  GpuPhotonBucket buckets[];
};
layout(scalar, set = 2, binding = BINDING_PHOTON_CONTROL) buffer PhotonControl {
  GpuPhotonControl photon_control;
};

// Lavapipe of Mesa 22.3 silently ends a loop after 65535 rounds; longer ones are cut into these.
const uint LOOP_CHUNK = 32768u;

ivec3 photon_cell(vec3 position) { return ivec3(floor(position / (2.0 * batch.photon_radius))); }

uint photon_bucket(ivec3 cell) {
  const uvec3 c = uvec3(cell);
  return hash_pair(hash_pair(c.x, c.y), c.z) & (buckets.length() - 1u);
}

bool photon_stored(GpuPhoton p) { return p.gain.x > 0.0 || p.gain.y > 0.0; }

#endif
