// Whole hits, for the tests.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tests/bench/tracers/shaders/ray.glsl"

struct FoundHit {
  float t;  // < 0: nothing
  float u, v;
  uint instance, primitive, presence;
};
writeonly buffer Hits { FoundHit hits[]; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  const vec4 origin = fetch(rays, int(2u * i));
  const vec4 direction = fetch(rays, int(2u * i + 1u));
  Hit hit;
  const bool found = trace_closest(origin.xyz, direction.xyz, origin.w, direction.w, worlds, hit);
  hits[i] = FoundHit(found ? hit.t : -1.0, hit.barycentrics.x, hit.barycentrics.y, hit.instance,
                     hit.primitive, hit.presence);
}
