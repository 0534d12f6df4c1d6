// Distance and primitive only, for the benchmarks: storing costs lavapipe more than it should.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tests/bench/tracers/shaders/ray.glsl"

writeonly buffer Distances { uvec2 distances[]; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  const vec4 origin = fetch(rays, int(2u * i));
  const vec4 direction = fetch(rays, int(2u * i + 1u));
  Hit hit;
  const bool found = trace_closest(origin.xyz, direction.xyz, origin.w, direction.w, worlds, hit);
  distances[i] = uvec2(floatBitsToUint(found ? hit.t : -1.0), hit.primitive);
}
