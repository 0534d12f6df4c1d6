// Finds the closest hit of every active path among the objects of its worlds. A path in both worlds
// traces one union ray (shaders/README.md, "Shared paths and forks").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/alpha.glsl"

void main() {
  if (gl_GlobalInvocationID.x >= control.active_count) return;
  const uint path = read_queue(active_queue_index(gl_GlobalInvocationID.x));
  const vec4 origin = read_ray_origin(path);
  const uint bits = read_throughput(path).state;
  // The path leaves its last hit, unless it starts here or resumes on its way.
  const bool leaves_surface = path_depth(bits) > 0u && origin.w == 0.0;
  const uvec2 source =
      leaves_surface ? read_hits(path * HIT_TEXELS) : TRACE_FROM_NOWHERE;
  const float t_min = path_is_behind(bits) ? origin.w : origin.w * RESUME_BEFORE;
  Hit hit;
  const bool found = closest_met(origin.xyz, read_ray_direction(path).xyz, t_min, 3.4e38,
                                 path_worlds(bits), source, hit);
  write_hit(path, GpuHit(found ? hit.t : -1.0, hit.barycentrics, hit.instance, hit.primitive));
}
