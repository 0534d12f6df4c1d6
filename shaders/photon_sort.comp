// Sorts the photons of each bucket by index: sums over them then round the same in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

// Heap sort: no memory of its own, and no bad case.
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

void main() {
  if (gl_GlobalInvocationID.x >= buckets.length()) return;
  const uint first = buckets[gl_GlobalInvocationID.x].first;
  const uint count = buckets[gl_GlobalInvocationID.x].count;
  if (count < 2u) return;
  const uint steps = count / 2u + count - 1u;
  for (uint chunk = 0u; chunk < steps; chunk += LOOP_CHUNK) {
    for (uint step = chunk; step < min(chunk + LOOP_CHUNK, steps); ++step) {
      if (step < count / 2u) {  // make the heap
        sift_down(first, count / 2u - 1u - step, count);
      } else {  // take the largest out, again and again
        const uint last = count - 1u - (step - count / 2u);
        const uint largest = photon_order[first];
        photon_order[first] = photon_order[first + last];
        photon_order[first + last] = largest;
        sift_down(first, 0u, last);
      }
    }
  }
}
