// Closest hits and shadow rays: through our own tree, or by the ray tracing units of a graphics card, for
// which a pass is compiled a second time with PREVIZ_RAY_QUERY. Both find the same, but for rounding. The
// includer must enable GL_GOOGLE_include_directive.
#ifndef PREVIZ_TRACE_GLSL
#define PREVIZ_TRACE_GLSL

#include "shaders/lib/hit.glsl"

// Finds the closest hit with t_min < t < t_max, t_min >= 0, among the instances that are present in
// any of `worlds`. `direction` may have any length but zero; t is in units of it. Where surfaces of
// two instances coincide, the lower instance is hit; where two triangles of an instance do, the
// lower primitive. `source` is the triangle that the ray leaves, or TRACE_FROM_NOWHERE.
bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                   out Hit hit);

// Returns the subset of `worlds` in which something lies between t_min and t_max. The search stops
// as soon as that is all of them.
uint trace_blocked(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source);

#ifdef PREVIZ_RAY_QUERY
#include "shaders/lib/trace_query.glsl"
#else
#include "shaders/lib/trace_tree.glsl"
#endif

// These trace rays that leave no triangle.
bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds,
                   out Hit hit) {
  return trace_closest(origin, direction, t_min, t_max, worlds, TRACE_FROM_NOWHERE, hit);
}
uint trace_blocked(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds) {
  return trace_blocked(origin, direction, t_min, t_max, worlds, TRACE_FROM_NOWHERE);
}

#endif
