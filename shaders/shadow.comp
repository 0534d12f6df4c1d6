// Traces shadow rays and adds the light that passes in each of their worlds. If every surface is
// opaque, one traversal serves both worlds.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/alpha.glsl"

void main() {
  if (gl_GlobalInvocationID.x >= control.shadow_count) return;
  const GpuShadowRay ray = read_shadow_ray(gl_GlobalInvocationID.x);
  const uint worlds = ray.path_and_worlds & 3u;
  const uint path = ray.path_and_worlds >> 3;
  const uvec2 source = read_hits(path * HIT_TEXELS);
  const Gain through = light_through(ray.origin, ray.direction, ray.t_max, worlds, source);
  add_pair(path_slot(path), worlds, (ray.path_and_worlds & 4u) != 0u,
           ray.mixed * through.mixed, ray.real * through.real);
}
