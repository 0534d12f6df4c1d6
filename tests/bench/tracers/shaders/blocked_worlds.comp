// The worlds in which each segment is blocked.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tests/bench/tracers/shaders/ray.glsl"

writeonly buffer Blocked { uint blocked[]; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  const vec4 origin = fetch(rays, int(2u * i));
  const vec4 direction = fetch(rays, int(2u * i + 1u));
  blocked[i] = trace_blocked(origin.xyz, direction.xyz, origin.w, direction.w, worlds);
}
