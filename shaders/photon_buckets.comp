// Writes the sorted photons in the layout that gathering reads, and the range of each bucket.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon_sort.glsl"

void write_sorted(uint photon, uint place) {
  const GpuPhoton p = photons[photon];
  sorted_photons[TEXELS_PER_PHOTON * place] = vec4(p.position, float(p.vertices));
  sorted_photons[TEXELS_PER_PHOTON * place + 1u] = vec4(p.direction, p.mixed.r);
  sorted_photons[TEXELS_PER_PHOTON * place + 2u] = vec4(p.normal, p.mixed.g);
  sorted_photons[TEXELS_PER_PHOTON * place + 3u] = vec4(p.mixed.b, p.real);
}

void main() {
  const uint place = gl_GlobalInvocationID.x;
  const uint stored = photon_control.stored;
  if (place >= stored) return;
  // batch.photon_digit is behind the last digit, hence key_at() reads what the last pass wrote.
  const uvec2 key = key_at(place);
  write_sorted(key.y, place);
  const uint before = key_at(max(place, 1u) - 1u).x;
  const uint behind = key_at(min(place + 1u, stored - 1u)).x;
  // A bucket's count is its end less its first place, which two invocations add to the 0 there.
  if (place == 0u || before != key.x) {
    buckets[key.x].first = place;
    atomicAdd(buckets[key.x].count, 0u - place);
  }
  if (place + 1u == stored || behind != key.x) atomicAdd(buckets[key.x].count, place + 1u);
}
