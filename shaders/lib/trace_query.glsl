// Closest hits and shadow rays by ray queries (GL_EXT_ray_query), through the structures of
// daemon/core/render/world/ray_structures.hpp. Internal to lib/trace.glsl and lib/alpha.glsl.
//
// Rays are tested as the hardware does it, so that a hit is that of lib/trace_tree.glsl but for
// rounding. What the hardware has no rule for is decided here: which of two surfaces in one place is hit, and that
// a ray never meets the triangle that it leaves. Both are asked in a second query. That for the
// triangle is rare, because rays start beside it. That for the place is short: it ends where it begins.
#ifndef PREVIZ_TRACE_QUERY_GLSL
#define PREVIZ_TRACE_QUERY_GLSL
#extension GL_EXT_ray_query : require

#include "shaders/lib/hit.glsl"

uniform accelerationStructureEXT ray_structure;

// Where a ray is asked about. `worlds` are the mask of the query: an instance's own is its presence.
struct QueriedRay {
  vec3 origin;
  float t_min;
  vec3 direction;
  float t_max;
  uint worlds;
  uvec2 source;
};

// All functions share one query: of two there is never need at once.
rayQueryEXT query;

// A ray that is none, with a NaN in it, meets nothing: for the hardware, anything could follow from it.
void query_begin(QueriedRay ray, uint flags) {
  const bool is_ray = ray.t_min <= ray.t_max &&
                      all(lessThan(abs(ray.origin) + abs(ray.direction), vec3(3.4e38)));
  rayQueryInitializeEXT(query, ray_structure, flags, is_ray ? ray.worlds : 0u,
                        is_ray ? ray.origin : vec3(0.0), is_ray ? ray.t_min : 0.0,
                        is_ray ? ray.direction : vec3(1.0), is_ray ? ray.t_max : 0.0);
}

// An instance has its presence where other programs keep the number of a shader.
Hit query_candidate() {
  return Hit(rayQueryGetIntersectionTEXT(query, false),
             rayQueryGetIntersectionBarycentricsEXT(query, false),
             uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
             uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)),
             rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, false));
}

// Goes on to the next surface that the flags leave to the shader, in no order, each once.
bool query_next(QueriedRay ray, out Hit candidate) {
  while (rayQueryProceedEXT(query)) {
    candidate = query_candidate();
    if (ray.source != uvec2(candidate.instance, candidate.primitive)) return true;
  }
  return false;
}

// Returns what a query that has ended has found.
bool query_found(inout Hit hit) {
  if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT)
    return false;
  hit = Hit(rayQueryGetIntersectionTEXT(query, true),
            rayQueryGetIntersectionBarycentricsEXT(query, true),
            uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)),
            uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true)),
            rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true));
  return true;
}

bool query_is_source(QueriedRay ray, Hit hit) {
  return ray.source == uvec2(hit.instance, hit.primitive);
}

// Returns by how much hits at about t may differ and be at the same place.
float query_tie(QueriedRay ray, float t) {
  const vec3 reach = abs(ray.origin);
  const vec3 pace = abs(ray.direction);
  return TRACE_TIE * (max(reach.x, max(reach.y, reach.z)) / max(pace.x, max(pace.y, pace.z)) + t);
}

// Returns the part of the ray that is at the same place as the hit.
QueriedRay query_around(QueriedRay ray, Hit hit) {
  const float tie = query_tie(ray, hit.t);
  ray.t_min = max(ray.t_min, hit.t - tie);
  ray.t_max = min(ray.t_max, hit.t + tie);
  return ray;
}

// Decides which of two hits at about the same place is the ray's, as lib/trace_tree.glsl does.
bool query_prefers(QueriedRay ray, Hit other, Hit hit) {
  const bool same = other.instance == hit.instance;
  const float gap = other.t - hit.t;
  if (abs(gap) > (same ? 0.0 : query_tie(ray, other.t))) return gap < 0.0;
  return same ? other.primitive < hit.primitive : other.instance < hit.instance;
}

Hit query_nothing(float t_max) { return Hit(t_max, vec2(0.0), 0xffffffffu, 0xffffffffu, 0u); }

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                   out Hit hit) {
  hit = query_nothing(t_max);
  const QueriedRay ray = QueriedRay(origin, t_min, direction, t_max, worlds, source);
  query_begin(ray, gl_RayFlagsOpaqueEXT);
  rayQueryProceedEXT(query);
  if (!query_found(hit)) return false;
  Hit candidate;
  if (query_is_source(ray, hit)) {
    hit = query_nothing(t_max);
    query_begin(ray, gl_RayFlagsNoOpaqueEXT);
    while (query_next(ray, candidate)) rayQueryConfirmIntersectionEXT(query);
    if (!query_found(hit)) return false;
  }
  query_begin(query_around(ray, hit), gl_RayFlagsNoOpaqueEXT);
  while (query_next(ray, candidate))
    if (query_prefers(ray, candidate, hit)) hit = candidate;
  return true;
}

// Returns the presence of the first thing that is found on the ray, 0 if there is nothing.
// `is_source`: it is the triangle that the ray leaves, and there may be others.
uint query_any(QueriedRay ray, uint flags, inout bool is_source) {
  Hit hit;
  query_begin(ray, flags | gl_RayFlagsTerminateOnFirstHitEXT);
  rayQueryProceedEXT(query);
  if (!query_found(hit)) return 0u;
  is_source = is_source || query_is_source(ray, hit);
  return hit.presence;
}

// Returns the worlds in which something opaque, as the flags say, is on the ray; no answer if
// `is_source` comes back.
uint query_blocked(QueriedRay ray, uint flags, out bool is_source) {
  is_source = false;
  const uint worlds = ray.worlds;
  const uint blocked = query_any(ray, flags, is_source) & worlds;
  if (is_source || blocked == 0u || blocked == worlds) return blocked;
  ray.worlds = worlds & ~blocked;  // what is in the way of one world is in that alone
  return blocked | (query_any(ray, flags, is_source) & worlds);
}

uint trace_blocked(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds,
                   uvec2 source) {
  const QueriedRay ray = QueriedRay(origin, t_min, direction, t_max, worlds, source);
  bool is_source;
  uint blocked = query_blocked(ray, gl_RayFlagsOpaqueEXT, is_source);
  if (!is_source) return blocked;
  blocked = 0u;
  Hit candidate;
  query_begin(ray, gl_RayFlagsNoOpaqueEXT);
  while (blocked != worlds && query_next(ray, candidate)) blocked |= candidate.presence & worlds;
  return blocked;
}

#endif
