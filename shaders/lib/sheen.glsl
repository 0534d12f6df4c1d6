// Sheen: the fibres of cloth, that stand on a surface and shine where they are seen from the side
// (KHR_materials_sheen; Conty Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF").
// The formulas are in shaders/README.md, "Sheen".
#ifndef PREVIZ_SHEEN_GLSL
#define PREVIZ_SHEEN_GLSL

#include "shaders/lib/albedo_table.glsl"
#include "shaders/lib/scene.glsl"

// Returns the share that white sheen sends back by its formula, which is above 1 for smooth sheen
// close to grazing.
float sheen_albedo(Surface s, float cosine) {
  const float rough = (s.sheen_roughness - LEAST_SHEEN_ROUGHNESS) / (1.0 - LEAST_SHEEN_ROUGHNESS);
  return interpolate_albedo(ALBEDO_SHEEN,
                            sqrt(clamp(vec2(cosine, rough), vec2(0.0), vec2(1.0))));
}

// Returns whether fibres are on the side of a direction. Solid glass has them on its outside only.
bool has_sheen_towards(Surface s, vec3 w) {
  if (!has_sheen(s)) return false;
  const bool is_solid = s.transmission > 0.0 && !s.thin_walled;
  return !is_solid || s.entering == (dot(w, s.geometric_normal) >= 0.0);
}

// Returns the share of light in a direction that fibres leave for what is below them.
float left_by_sheen(Surface s, vec3 w) {
  if (!has_sheen_towards(s, w)) return 1.0;
  const float strongest = max(max(s.sheen_color.r, s.sheen_color.g), s.sheen_color.b);
  return 1.0 - strongest * min(sheen_albedo(s, abs(dot(w, s.normal))), 1.0);
}

// The logarithm of lambda below a cosine of 1/2 (ibid., equation 3 and table 1).
float sheen_log_lambda(float x, float alpha) {
  const float smoothness = (1.0 - alpha) * (1.0 - alpha);
  const float a = mix(21.5473, 25.3245, smoothness);
  const float b = mix(3.82987, 3.32435, smoothness);
  const float c = mix(0.19823, 0.16801, smoothness);
  const float d = mix(-1.97760, -1.27393, smoothness);
  const float e = mix(-4.32054, -4.85967, smoothness);
  return a / (1.0 + b * pow(x, c)) + d * x + e;
}

float sheen_lambda(float cosine, float alpha) {
  if (cosine < 0.5) return exp(sheen_log_lambda(max(cosine, 0.0), alpha));
  return exp(2.0 * sheen_log_lambda(0.5, alpha) -
             sheen_log_lambda(max(1.0 - cosine, 0.0), alpha));
}

// Returns f * cos of white sheen by its formula, for directions above the shading normal's plane.
float sheen_value(Surface s, vec3 wi) {
  const float alpha = s.sheen_roughness * s.sheen_roughness;
  const float cos_o = dot(s.normal, s.wo);
  const float cos_h = dot(s.normal, normalize(s.wo + wi));
  const float sine2 = max(1.0 - cos_h * cos_h, 0.0);
  const float density = (2.0 + 1.0 / alpha) * pow(sine2, 0.5 / alpha) / (2.0 * PI);
  const float masked =
      1.0 + sheen_lambda(cos_o, alpha) + sheen_lambda(dot(s.normal, wi), alpha);
  return density / (masked * 4.0 * cos_o);
}

#endif
