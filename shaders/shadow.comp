// Shadow rays: one traversal finds in which of a sample's worlds the light is blocked.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/path.glsl"
#include "shaders/lib/trace.glsl"

void main() {
  if (gl_GlobalInvocationID.x >= control.shadow_count) return;
  const GpuShadowRay ray = shadow_rays[gl_GlobalInvocationID.x];
  const uint worlds = ray.slot_and_worlds & 3u;
  const uint blocked = trace_blocked(ray.origin, ray.direction, 0.0, ray.t_max, worlds);
  add_radiance(ray.slot_and_worlds >> 2, worlds & ~blocked, ray.contribution, ray.gain);
}
