// Compacted appends: one atomic a subgroup.
#ifndef PREVIZ_APPEND_GLSL
#define PREVIZ_APPEND_GLSL

#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "shaders/lib/path.glsl"

// Must be reached by the whole subgroup; `wanted` says who appends.
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
