// The buffers of a pass of photons while they are traced and sorted, and the photons' random
// numbers.
#ifndef PREVIZ_PHOTON_GLSL
#define PREVIZ_PHOTON_GLSL

#include "shaders/lib/photon_grid.glsl"

layout(scalar) buffer Photons { GpuPhoton photons[]; };  // 2 * photon_count; two, for a fork
layout(scalar) buffer Keys { uint photon_keys[]; };      // of photons: the bucket; NO_INDEX: not stored
layout(scalar) buffer Order { uvec2 photon_order[]; };   // buckets and photons, twice (photon_sort.glsl)
layout(scalar) buffer PhotonControl { GpuPhotonControl photon_control; };
layout(scalar) buffer Sorted { vec4 sorted_photons[]; };  // found_photons, to write
layout(scalar) buffer Buckets { GpuPhotonBucket buckets[]; };  // a power of two; found_buckets

// The photons of 4096 passes are one sequence of samples, so that they spread evenly over the
// passes as well. Both halves of a photon that forked share its numbers.
Sampler photon_sampler(uint photon) {
  const uint passes = 4096u;
  const uint pass = frame.past_samples + batch.first_sample;
  return make_sampler(frame.seed, uvec2(NO_INDEX, pass / passes),
                      (pass % passes) * frame.photon_count + photon);
}

// These are the dimension pairs of a photon.
const uint PAIR_EMITTER = 0u;  // x: which light, y: which bound
const uint PAIR_ON_LIGHT = 1u;
const uint PAIR_AIM = 2u;
const uint PAIR_BOUNCE = 3u;   // plus the vertex; x: whether to stay, and the lobe; y: roulette

#endif
