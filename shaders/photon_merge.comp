// Sorts the photons of large buckets by index, as photon_sort.comp does those of small ones. Each pass
// merges sorted runs; each invocation moves one photon to where it lies among those of its own run and
// of the others, which it finds by binary search. So the work of an invocation grows with the logarithm
// of the photons of a focus only. The last pass of a bucket writes its photons as gathering reads them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/sorted_photon.glsl"

// The passes read and write two orders in turns. From the first pass on, both have some photon of its
// own bucket in every place.
bool reads_order() { return (batch.photon_merge & 1u) == 0u; }
uint photon_at(uint place) { return reads_order() ? photon_order[place] : filled[place]; }
void put_photon(uint photon, uint place) {
  if (reads_order()) filled[place] = photon;
  else photon_order[place] = photon;
}

// Returns how many photons of a sorted run come before this one.
uint count_before(uint photon, uint first, uint end) {
  uint low = first;
  while (low < end) {
    const uint middle = (low + end) / 2u;
    if (photon_at(middle) < photon) low = middle + 1u;
    else end = middle;
  }
  return low - first;
}

void main() {
  const uint place = gl_GlobalInvocationID.x;
  if (place >= photon_control.stored) return;
  const uint photon = photon_at(place);
  const GpuPhotonBucket bucket = buckets[photon_bucket(photons[photon].position)];
  uint run = 1u;
  for (uint pass = 0u; pass < batch.photon_merge; ++pass) run *= PHOTON_RUNS_MERGED;
  if (bucket.count <= SMALL_BUCKET && run == 1u) put_photon(photon, place);
  if (bucket.count <= SMALL_BUCKET || run >= bucket.count) return;
  const uint merged = run * PHOTON_RUNS_MERGED;
  const uint in_bucket = place - bucket.first;
  const uint own = in_bucket / run * run;
  uint before = in_bucket - own;
  const uint first = own / merged * merged;
  for (uint other = first; other < min(first + merged, bucket.count); other += run)
    if (other != own)
      before += count_before(photon, bucket.first + other,
                             bucket.first + min(other + run, bucket.count));
  if (merged >= bucket.count) write_sorted(photon, bucket.first + before);
  else put_photon(photon, bucket.first + first + before);
}
