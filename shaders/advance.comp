// Runs between two segments, as one invocation: the queue that was filled becomes the active one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/path.glsl"

void main() {
  if (gl_GlobalInvocationID.x != 0u) return;
  control.queue_side = 1u - control.queue_side;
  control.active_count = control.next_count;
  control.next_count = 0u;
  control.shadow_count = 0u;
  control.extend_groups[0] = (control.active_count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
  const uint sum = control.rays_low + control.active_count;
  control.rays_high += uint(sum < control.rays_low);
  control.rays_low = sum;
}
