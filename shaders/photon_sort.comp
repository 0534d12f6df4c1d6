// Sorts the photons of each bucket by index, so that sums over them round alike in every run and in
// both worlds, and writes them in the layout that gathering reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

// Heap sort needs no memory of its own and has no bad case. This moves the root of a heap to its
// place.
void sift_down(uint first, uint root, uint count) {
  const uint value = photon_order[first + root];
  for (uint child = 2u * root + 1u; child < count; child = 2u * root + 1u) {
    if (child + 1u < count && photon_order[first + child] < photon_order[first + child + 1u]) ++child;
    if (photon_order[first + child] <= value) break;
    photon_order[first + root] = photon_order[first + child];
    root = child;
  }
  photon_order[first + root] = value;
}

void sort_bucket(uint first, uint count) {
  const uint steps = count / 2u + count - 1u;
  for (uint chunk = 0u; chunk < steps; chunk += LOOP_CHUNK) {
    for (uint step = chunk; step < min(chunk + LOOP_CHUNK, steps); ++step) {
      if (step < count / 2u) {  // builds the heap
        sift_down(first, count / 2u - 1u - step, count);
      } else {  // removes the largest, again and again
        const uint last = count - 1u - (step - count / 2u);
        const uint largest = photon_order[first];
        photon_order[first] = photon_order[first + last];
        photon_order[first + last] = largest;
        sift_down(first, 0u, last);
      }
    }
  }
}

void write_sorted(uint place) {
  const GpuPhoton p = photons[photon_order[place]];
  sorted_photons[TEXELS_PER_PHOTON * place] = vec4(p.position, float(p.vertices));
  sorted_photons[TEXELS_PER_PHOTON * place + 1u] = vec4(p.direction, p.mixed.r);
  sorted_photons[TEXELS_PER_PHOTON * place + 2u] = vec4(p.normal, p.mixed.g);
  sorted_photons[TEXELS_PER_PHOTON * place + 3u] = vec4(p.mixed.b, p.real);
}

void main() {
  if (gl_GlobalInvocationID.x >= photon_bucket_count()) return;
  const GpuPhotonBucket bucket = buckets[gl_GlobalInvocationID.x];
  if (bucket.count > 1u) sort_bucket(bucket.first, bucket.count);
  const uint end = bucket.first + bucket.count;
  for (uint chunk = bucket.first; chunk < end; chunk += LOOP_CHUNK)
    for (uint place = chunk; place < min(chunk + LOOP_CHUNK, end); ++place) write_sorted(place);
}
