// The closest hit of every active path among what its worlds contain. A path in both worlds traces
// one union ray (estimator.md).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/alpha.glsl"

// A resumed ray starts just before where its path parted: what is there is not in its world.
const float RESUME_BEFORE = 0.9999;

void main() {
  if (gl_GlobalInvocationID.x >= control.active_count) return;
  const uint path = queue[active_queue_index(gl_GlobalInvocationID.x)];
  const vec4 origin = ray_origin[path];
  const uint bits = floatBitsToUint(path_throughput[path].w);
  Hit hit;
  const bool found = closest_met(origin.xyz, ray_direction[path].xyz, origin.w * RESUME_BEFORE,
                                 3.4e38, path_worlds(bits), hit);
  hits[path] = GpuHit(found ? hit.t : -1.0, hit.barycentrics, hit.instance, hit.primitive);
}
