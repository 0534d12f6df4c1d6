// Appends to the compacted queues. A subgroup needs a single atomic operation for all its lanes, where
// they are known to be together; otherwise each lane adds by itself.
#ifndef PREVIZ_APPEND_GLSL
#define PREVIZ_APPEND_GLSL

#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "shaders/lib/device.glsl"
#include "shaders/lib/path.glsl"

// Each returns the place of a lane with `wanted` in a queue that has this counter. They must be called
// by all lanes of a subgroup.
#define PREVIZ_PLACE(name, counter)                                        \
  uint name(bool wanted) {                                                 \
    uint first = 0u;                                                       \
    if (!lanes_meet()) {                                                     \
      if (wanted) first = atomicAdd(counter, 1u);                          \
      return first;                                                        \
    }                                                                      \
    const uvec4 ballot = subgroupBallot(wanted);                           \
    const uint count = subgroupBallotBitCount(ballot);                     \
    if (count == 0u) return 0u;                                            \
    if (subgroupElect()) first = atomicAdd(counter, count);                \
    return subgroupBroadcastFirst(first) + subgroupBallotExclusiveBitCount(ballot); \
  }
PREVIZ_PLACE(place_in_next, control.next_count)
PREVIZ_PLACE(place_in_shadow, control.shadow_count)

// These too must be called by all lanes; the lanes with `wanted` append.
void append_next(bool wanted, uint path) {
  const uint place = place_in_next(wanted);
  if (wanted) queue[next_queue_index(place)] = path;
}

void append_shadow(bool wanted, GpuShadowRay ray) {
  const uint place = place_in_shadow(wanted);
  if (wanted) write_shadow_ray(place, ray);
}

#endif
