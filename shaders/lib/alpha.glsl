// Rays among surfaces with transparent parts. The closest hit may pass through a surface, as its
// alpha says or because it is a pane, and shadow rays are weakened by the surfaces that they cross.
// Without FEATURE_ALPHA and FEATURE_PANES these functions do what those of lib/trace.glsl do.
#ifndef PREVIZ_ALPHA_GLSL
#define PREVIZ_ALPHA_GLSL

#include "shaders/lib/pane.glsl"
#include "shaders/lib/path.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/trace.glsl"

// Returns the alpha of the surface at the hit, 1 where the surface is opaque.
float hit_coverage(Hit hit) {
  return coverage(hit.instance, hit.primitive, hit.barycentrics);
}

vec3 hit_transmittance(Hit hit, vec3 direction) {
  if (!may_be_pane(instance_at(hit.instance).material)) return vec3(0.0);
  return pane_transmittance(
      make_surface(GpuHit(hit.t, hit.barycentrics, hit.instance, hit.primitive), direction, 0.0));
}

// Decides whether the ray meets the surface; the probability is the surface's coverage, less what
// passes it as a pane.
bool is_met(Hit hit, vec3 origin, vec3 direction) {
  const float share = has_feature(FEATURE_ALPHA) ? hit_coverage(hit) : 1.0;
  const float passes =
      has_feature(FEATURE_PANES) ? least_of(hit_transmittance(hit, direction)) : 0.0;
  if (share >= 1.0 && passes <= 0.0) return true;
  const uint key = hash_meeting(hit.instance, hit.primitive, origin, direction);
  return (share >= 1.0 || unit_float(key) < share) &&
         (passes <= 0.0 || unit_float(hash_bits(key ^ KEY_PASSES)) >= passes);
}

// Takes from the share of light in each world what the surface at the hit keeps. Returns the worlds in
// which none is left by it.
uint take_from(inout Gain share, Hit hit, vec3 direction) {
  const float coverage = has_feature(FEATURE_ALPHA) ? hit_coverage(hit) : 1.0;
  vec3 through = vec3(1.0 - coverage);
  if (has_feature(FEATURE_PANES)) through += coverage * hit_transmittance(hit, direction);
  if ((hit.presence & WORLD_MIXED) != 0u) share.mixed *= through;
  if ((hit.presence & WORLD_REAL) != 0u) share.real *= through;
  return all(lessThanEqual(through, vec3(0.0))) ? hit.presence : 0u;
}

#ifdef PREVIZ_RAY_QUERY

// Surfaces with transparent parts are left to the shader, in any order. What meets them does not depend on it.
bool closest_candidate_met(QueriedRay ray, uint flags, inout Hit hit) {
  Hit candidate;
  query_begin(ray, flags);
  while (query_next(ray, candidate))
    if (is_met(candidate, ray.origin, ray.direction)) rayQueryConfirmIntersectionEXT(query);
  return query_found(hit);
}

bool closest_through(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                     out Hit hit) {
  const QueriedRay ray = QueriedRay(origin, t_min, direction, t_max, worlds, source);
  hit = query_nothing(t_max);
  if (!closest_candidate_met(ray, gl_RayFlagsNoneEXT, hit)) return false;
  if (query_is_source(ray, hit)) {
    hit = query_nothing(t_max);
    if (!closest_candidate_met(ray, gl_RayFlagsNoOpaqueEXT, hit)) return false;
  }
  Hit candidate;
  query_begin(query_around(ray, hit), gl_RayFlagsNoOpaqueEXT);
  while (query_next(ray, candidate))
    if (query_prefers(ray, candidate, hit) && is_met(candidate, ray.origin, ray.direction)) hit = candidate;
  return true;
}

Gain share_through(vec3 origin, vec3 direction, float t_max, uint worlds, uvec2 source, Gain share) {
  QueriedRay ray = QueriedRay(origin, 0.0, direction, t_max, worlds, source);
  bool is_source;
  const uint dark = query_blocked(ray, gl_RayFlagsCullNoOpaqueEXT, is_source);
  uint shown = gl_RayFlagsNoOpaqueEXT;
  if (!is_source) {  // only open surfaces are left, for the worlds that are not dark
    shown = gl_RayFlagsCullOpaqueEXT;
    share.mixed *= float((dark & WORLD_MIXED) == 0u);
    share.real *= float((dark & WORLD_REAL) == 0u);
    worlds &= ~dark;
    ray.worlds = worlds;
    if (worlds == 0u) return share;
  }
  Hit hit;
  Hit last = query_nothing(t_max);
  query_begin(ray, shown);
  while (worlds != 0u && query_next(ray, hit)) {
    // On an edge that two triangles share both may be met, one after the other.
    const bool is_passed = hit.instance == last.instance && abs(hit.t - last.t) <= query_tie(ray, hit.t);
    if (!is_passed) worlds &= ~take_from(share, hit, direction);
    last = hit;
  }
  return share;
}

#else

// A ray passes at most so many transparent surfaces. The next one stops it, which is counted in
// control.stopped_in_layers.
const uint MAX_LAYERS = 256u;

bool closest_through(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                     out Hit hit) {
  for (uint layer = 0u; layer < MAX_LAYERS; ++layer) {
    if (!trace_closest(origin, direction, t_min, t_max, worlds, source, hit)) return false;
    if (is_met(hit, origin, direction)) return true;
    t_min = hit.t;
  }
  atomicAdd(control.stopped_in_layers, 1u);
  return trace_closest(origin, direction, t_min, t_max, worlds, source, hit);
}

Gain share_through(vec3 origin, vec3 direction, float t_max, uint worlds, uvec2 source, Gain share) {
  float t_min = 0.0;
  for (uint layer = 0u; worlds != 0u; ++layer) {
    if (layer == MAX_LAYERS) {
      atomicAdd(control.stopped_in_layers, 1u);
      return Gain(vec3(0.0), vec3(0.0));
    }
    Hit hit;
    if (!trace_closest(origin, direction, t_min, t_max, worlds, source, hit)) return share;
    worlds &= ~take_from(share, hit, direction);
    t_min = hit.t;
  }
  return share;
}

#endif

// Finds the closest surface that the ray meets, as trace_closest() does.
bool closest_met(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                 out Hit hit) {
  if (!has_feature(FEATURE_ALPHA | FEATURE_PANES))
    return trace_closest(origin, direction, t_min, t_max, worlds, source, hit);
  return closest_through(origin, direction, t_min, t_max, worlds, source, hit);
}

// Returns the share of light that passes along the ray in each world; it is 0 in a world that is not
// in `worlds`.
Gain light_through(vec3 origin, vec3 direction, float t_max, uint worlds, uvec2 source) {
  const Gain share = Gain(vec3((worlds & WORLD_MIXED) != 0u), vec3((worlds & WORLD_REAL) != 0u));
  if (!has_feature(FEATURE_ALPHA | FEATURE_PANES)) {
    const uint blocked = trace_blocked(origin, direction, 0.0, t_max, worlds, source);
    return Gain(share.mixed * float((blocked & WORLD_MIXED) == 0u),
                share.real * float((blocked & WORLD_REAL) == 0u));
  }
  return share_through(origin, direction, t_max, worlds, source, share);
}

#endif
