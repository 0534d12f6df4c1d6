// The tables of directional albedo (daemon/core/render/world/albedo_table.hpp).
#ifndef PREVIZ_ALBEDO_TABLE_GLSL
#define PREVIZ_ALBEDO_TABLE_GLSL

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/render_shared.h"

// Tables of ALBEDO_SIDE^2: the reflection's, that of sheen if any surface has some, then for
// each rough glass one seen from outside and one from inside, and for each anisotropic metal
// ANISOTROPIC_TABLES.
PREVIZ_FETCHED(float, albedo)

// Looks up a table bilinearly; `place` is the column and the row, each from 0 to 1.
float interpolate_albedo(uint table, vec2 place) {
  const float last = float(ALBEDO_SIDE - 1u);
  const vec2 at = place * last;
  const vec2 low = min(floor(at), vec2(last - 1.0));
  const vec2 f = at - low;
  const int first = int(table * ALBEDO_SIDE * ALBEDO_SIDE + uint(low.y) * ALBEDO_SIDE + uint(low.x));
  const int side = int(ALBEDO_SIDE);
  const float below = mix(fetch(albedo, first), fetch(albedo, first + 1), f.x);
  const float above = mix(fetch(albedo, first + side), fetch(albedo, first + side + 1), f.x);
  return mix(below, above, f.y);
}

// Returns the share of light that single scattering reflects, seen under this cosine.
float single_scatter_albedo(uint table, float cos_o, float alpha) {
  return interpolate_albedo(table, sqrt(clamp(vec2(cos_o, alpha), vec2(0.0), vec2(1.0))));
}

// Returns the albedo of an anisotropic reflection without its further bounces; `across` is the
// viewer's direction across the normal, along the wider and the narrower direction, and `alpha` the
// width along the narrower one.
float anisotropic_albedo(uint first_table, vec2 across, float cos_o, float alpha) {
  const float last = float(ANISOTROPIC_TABLES - 1u);
  const float size = length(across);
  const float at = size > 0.0 ? sqrt(min(abs(across.x) / size, 1.0)) * last : last;
  const float low = min(floor(at), last - 1.0);
  const uint table = first_table + uint(low);
  return mix(single_scatter_albedo(table, cos_o, alpha),
             single_scatter_albedo(table + 1u, cos_o, alpha), at - low);
}

#endif
