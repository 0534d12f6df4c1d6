// Appends to the compacted queues; a subgroup needs a single atomic operation for all its lanes.
#ifndef PREVIZ_APPEND_GLSL
#define PREVIZ_APPEND_GLSL

#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "shaders/lib/path.glsl"

// Both functions must be called by all lanes of a subgroup; the lanes with `wanted` append.
void append_next(bool wanted, uint path) {
  const uvec4 ballot = subgroupBallot(wanted);
  const uint count = subgroupBallotBitCount(ballot);
  if (count == 0u) return;
  uint first = 0u;
  if (subgroupElect()) first = atomicAdd(control.next_count, count);
  first = subgroupBroadcastFirst(first);
  if (wanted) queue[next_queue_index(first + subgroupBallotExclusiveBitCount(ballot))] = path;
}

void append_shadow(bool wanted, GpuShadowRay ray) {
  const uvec4 ballot = subgroupBallot(wanted);
  const uint count = subgroupBallotBitCount(ballot);
  if (count == 0u) return;
  uint first = 0u;
  if (subgroupElect()) first = atomicAdd(control.shadow_count, count);
  first = subgroupBroadcastFirst(first);
  if (wanted) shadow_rays[first + subgroupBallotExclusiveBitCount(ballot)] = ray;
}

#endif
