// Sorts the photons of each small bucket by index, so that sums over them round alike in every run and
// in both worlds, and writes them in the layout that gathering reads. Large buckets are left to
// photon_merge.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/sorted_photon.glsl"

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
  for (uint root = count / 2u; root-- > 0u;) sift_down(first, root, count);
  for (uint last = count - 1u; last > 0u; --last) {  // removes the largest, again and again
    const uint largest = photon_order[first];
    photon_order[first] = photon_order[first + last];
    photon_order[first + last] = largest;
    sift_down(first, 0u, last);
  }
}

void main() {
  if (gl_GlobalInvocationID.x >= photon_bucket_count()) return;
  const GpuPhotonBucket bucket = buckets[gl_GlobalInvocationID.x];
  if (bucket.count > SMALL_BUCKET) return;
  if (bucket.count > 1u) sort_bucket(bucket.first, bucket.count);
  const uint end = bucket.first + bucket.count;
  for (uint place = bucket.first; place < end; ++place) write_sorted(photon_order[place], place);
}
