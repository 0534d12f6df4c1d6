// Rays among surfaces with transparent parts. The closest hit may pass through a surface, as its
// alpha says, and shadow rays are weakened by the surfaces that they cross. Without FEATURE_ALPHA
// these functions do what those of lib/trace.glsl do.
#ifndef PREVIZ_ALPHA_GLSL
#define PREVIZ_ALPHA_GLSL

#include "shaders/lib/path.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/trace.glsl"

// A ray passes at most so many transparent surfaces. The next one stops it, which is counted in
// control.stopped_in_layers.
const uint MAX_LAYERS = 256u;

// Returns the alpha of the surface at the hit, 1 where the surface is opaque.
float hit_coverage(Hit hit) {
  const uint material = instances[hit.instance].material;
  if (materials[material].alpha_mode == ALPHA_OPAQUE) return 1.0;
  return coverage(material, hit_uv(hit.instance, hit.primitive, hit.barycentrics));
}

// Decides whether the ray meets the surface; the probability is the surface's coverage. A hash of
// the ray and the surface is as good as a random number, because no two rays are alike, and it
// gives both worlds of a ray the same decision.
bool is_met(Hit hit, vec3 origin, vec3 direction) {
  const float share = hit_coverage(hit);
  if (share >= 1.0) return true;
  uint key = hash_pair(hit.instance, hit.primitive);
  key = hash_pair(key, hash_pair(floatBitsToUint(direction.x), floatBitsToUint(direction.y)));
  key = hash_pair(key, hash_pair(floatBitsToUint(direction.z), floatBitsToUint(origin.x)));
  key = hash_pair(key, hash_pair(floatBitsToUint(origin.y), floatBitsToUint(origin.z)));
  return unit_float(key) < share;
}

// Finds the closest surface that the ray meets, as trace_closest() does.
bool closest_met(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                 out Hit hit) {
  if (!has_feature(FEATURE_ALPHA))
    return trace_closest(origin, direction, t_min, t_max, worlds, source, hit);
  for (uint layer = 0u; layer < MAX_LAYERS; ++layer) {
    if (!trace_closest(origin, direction, t_min, t_max, worlds, source, hit)) return false;
    if (is_met(hit, origin, direction)) return true;
    t_min = hit.t;
  }
  atomicAdd(control.stopped_in_layers, 1u);
  return trace_closest(origin, direction, t_min, t_max, worlds, source, hit);
}

// Returns the share of light that passes along the ray in the (mixed, real) world; it is 0 in a
// world that is not in `worlds`.
vec2 light_through(vec3 origin, vec3 direction, float t_max, uint worlds, uvec2 source) {
  vec2 share = vec2((worlds & WORLD_MIXED) != 0u, (worlds & WORLD_REAL) != 0u);
  if (!has_feature(FEATURE_ALPHA)) {
    const uint blocked = trace_blocked(origin, direction, 0.0, t_max, worlds, source);
    return share * vec2((blocked & WORLD_MIXED) == 0u, (blocked & WORLD_REAL) == 0u);
  }
  float t_min = 0.0;
  for (uint layer = 0u; worlds != 0u; ++layer) {
    if (layer == MAX_LAYERS) {
      atomicAdd(control.stopped_in_layers, 1u);
      return vec2(0.0);
    }
    Hit hit;
    if (!trace_closest(origin, direction, t_min, t_max, worlds, source, hit)) return share;
    const float through = 1.0 - hit_coverage(hit);
    if ((hit.presence & WORLD_MIXED) != 0u) share.x *= through;
    if ((hit.presence & WORLD_REAL) != 0u) share.y *= through;
    if (through <= 0.0) worlds &= ~hit.presence;
    t_min = hit.t;
  }
  return share;
}

#endif
