// Traces shadow rays and adds the light that passes in each of their worlds. If every surface is
// opaque, one traversal serves both worlds.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/alpha.glsl"

void main() {
  if (gl_GlobalInvocationID.x >= control.shadow_count) return;
  const GpuShadowRay ray = shadow_rays[gl_GlobalInvocationID.x];
  const uint worlds = ray.slot_and_worlds & 3u;
  const vec2 through = light_through(ray.origin, ray.direction, ray.t_max, worlds);
  add_pair(ray.slot_and_worlds >> 3, worlds, (ray.slot_and_worlds & 4u) != 0u,
           ray.mixed * through.x, ray.real * through.y);
}
