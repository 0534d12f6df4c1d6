// Runs between shading and shadow rays, as one invocation: it prepares the dispatch of the shadow
// rays and counts them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/path.glsl"

void main() {
  if (gl_GlobalInvocationID.x != 0u) return;
  control.shadow_groups[0] = (control.shadow_count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
  const uint sum = control.shadow_rays_low + control.shadow_count;
  control.shadow_rays_high += uint(sum < control.shadow_rays_low);
  control.shadow_rays_low = sum;
}
