// The photons of a pass while they are made and sorted.
#ifndef PREVIZ_PHOTON_GLSL
#define PREVIZ_PHOTON_GLSL

#include "shaders/lib/photon_grid.glsl"

layout(scalar, set = 2, binding = BINDING_PHOTONS) buffer Photons { GpuPhoton photons[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_ORDER) buffer Order { uint photon_order[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_FILLED) buffer Filled { uint filled[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_CONTROL) buffer PhotonControl {
  GpuPhotonControl photon_control;
};
layout(scalar, set = 2, binding = BINDING_PHOTON_SORTED) buffer Sorted { vec4 sorted_photons[]; };
layout(scalar, set = 2, binding = BINDING_PHOTON_BUCKETS) buffer Buckets {
  GpuPhotonBucket buckets[];
};

// All photons of many passes are one sequence; both worlds' parts of a photon share its numbers.
Sampler photon_sampler(uint photon) {
  const uint passes = 4096u;
  return make_sampler(frame.seed, uvec2(NO_INDEX, batch.first_sample / passes),
                      (batch.first_sample % passes) * frame.photon_count + photon);
}

// Dimension pairs of a photon.
const uint PAIR_EMITTER = 0u;  // x: which light, y: which bound
const uint PAIR_ON_LIGHT = 1u;
const uint PAIR_AIM = 2u;
const uint PAIR_BOUNCE = 3u;   // plus the vertex; x: stay or go on, and how; y: roulette

#endif
