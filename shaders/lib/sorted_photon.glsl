// Writes photons in the layout that gathering reads.
#ifndef PREVIZ_SORTED_PHOTON_GLSL
#define PREVIZ_SORTED_PHOTON_GLSL

#include "shaders/lib/photon.glsl"

void write_sorted(uint photon, uint place) {
  const GpuPhoton p = photons[photon];
  sorted_photons[TEXELS_PER_PHOTON * place] = vec4(p.position, float(p.vertices));
  sorted_photons[TEXELS_PER_PHOTON * place + 1u] = vec4(p.direction, p.mixed.r);
  sorted_photons[TEXELS_PER_PHOTON * place + 2u] = vec4(p.normal, p.mixed.g);
  sorted_photons[TEXELS_PER_PHOTON * place + 3u] = vec4(p.mixed.b, p.real);
}

#endif
