// Assigns each bucket its range of the order, and asks for photon_merge.comp where a bucket is large.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"

void main() {
  const uint bucket = gl_GlobalInvocationID.x;
  if (bucket >= photon_bucket_count()) return;
  const uint count = buckets[bucket].count;
  if (count > 0u) buckets[bucket].first = atomicAdd(photon_control.stored, count);
  if (count <= SMALL_BUCKET) return;
  atomicMax(photon_control.merge_groups[0],
            (2u * frame.photon_count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
  atomicMax(photon_control.merge_groups[1], 1u);
  atomicMax(photon_control.merge_groups[2], 1u);
}
