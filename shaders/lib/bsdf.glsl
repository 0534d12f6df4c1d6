// Scattering at a surface: Lambert, GGX reflection (dielectric coat and conductor), smooth glass.
// Definitions are those of tests/truth/README.md, which an independent CPU tracer follows too.
#ifndef PREVIZ_BSDF_GLSL
#define PREVIZ_BSDF_GLSL

#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"

float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }

// Unpolarised reflectance of a smooth interface; eta = ior of the far side over the near side.
float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1.0) return 1.0;
  const float cos_t = sqrt(1.0 - sin2_t);
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

vec3 fresnel_schlick(vec3 f0, float cos_i) {
  const float m = clamp(1.0 - cos_i, 0.0, 1.0);
  const float m2 = m * m;
  return f0 + (vec3(1.0) - f0) * (m2 * m2 * m);
}

// Orthonormal basis around n (Duff et al. 2017).
mat3 make_frame(vec3 n) {
  const float side = n.z >= 0.0 ? 1.0 : -1.0;
  const float a = -1.0 / (side + n.z);
  const float b = n.x * n.y * a;
  return mat3(vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x),
              vec3(b, side + n.y * n.y * a, -n.y), n);
}

vec2 sample_disc(vec2 u) {
  const float r = sqrt(u.x);
  const float phi = 2.0 * PI * u.y;
  return r * vec2(cos(phi), sin(phi));
}

vec3 sample_cosine(vec2 u) {
  const vec2 d = sample_disc(u);
  return vec3(d, sqrt(max(0.0, 1.0 - u.x)));
}

// GGX in the local frame (z the normal). Written in the half vector's x and y, which stay accurate
// where 1 - z^2 would cancel.
float ggx_density(vec3 h, float alpha) {
  const float a2 = alpha * alpha;
  const float d = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
  return 1.0 / (PI * a2 * d * d);
}
float ggx_lambda(vec3 w, float alpha) {
  const float tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
  return 0.5 * (sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

// Half vector by the distribution of visible normals (Dupuy and Benyoub 2023, spherical caps).
vec3 sample_ggx(vec3 wo, float alpha, vec2 u) {
  const vec3 stretched = normalize(vec3(wo.xy * alpha, wo.z));
  const float phi = 2.0 * PI * u.x;
  const float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
  const float sin_theta = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
  const vec3 cap = vec3(sin_theta * cos(phi), sin_theta * sin(phi), z) + stretched;
  return normalize(vec3(cap.xy * alpha, cap.z));
}

// The lobes of a surface seen from wo: their weights, and the odds of sampling each.
struct Lobes {
  vec3 diffuse;         // albedo
  float coat;           // weight of the white dielectric reflection
  vec3 conductor;       // reflectance at normal incidence times its weight
  float conductor_weight;
  float glass;
  float p_diffuse, p_reflection, p_glass;
  bool smooth_reflection;  // the reflection is a Dirac delta
};

Lobes make_lobes(Surface s) {
  Lobes l;
  const float nv = abs(dot(s.normal, s.wo));
  const float opaque = (1.0 - s.metallic) * (1.0 - s.transmission);
  l.coat = 0.0;
  l.conductor = vec3(0.0);
  l.conductor_weight = 0.0;
  l.smooth_reflection = false;
  float reflection = 0.0;
  if (has_feature(FEATURE_GLOSSY)) {
    if (opaque > 0.0 && s.specular > 0.0) l.coat = s.specular * fresnel_dielectric(nv, s.ior);
    l.conductor_weight = s.metallic;
    l.conductor = s.base_color;
    l.smooth_reflection = s.alpha <= frame.specular_alpha;
    reflection = opaque * l.coat;
    if (s.metallic > 0.0) reflection += s.metallic * luminance(fresnel_schlick(s.base_color, nv));
  }
  l.diffuse = opaque * (1.0 - l.coat) * s.base_color;
  l.coat *= opaque;
  l.glass = has_feature(FEATURE_TRANSMISSION) ? (1.0 - s.metallic) * s.transmission : 0.0;
  const float diffuse = luminance(l.diffuse);
  const float total = diffuse + reflection + l.glass;
  const float scale = total > 0.0 ? 1.0 / total : 0.0;
  l.p_diffuse = diffuse * scale;
  l.p_reflection = reflection * scale;
  l.p_glass = l.glass * scale;
  return l;
}

vec3 reflection_color(Lobes l, float cos_half) {
  return vec3(l.coat) + l.conductor_weight * fresnel_schlick(l.conductor, cos_half);
}

// A reflected direction counts only if it is above both the surface and the shading normal.
bool reflects_to(Surface s, vec3 wi) {
  return dot(wi, s.geometric_normal) > 0.0 && dot(wi, s.normal) > 0.0;
}

// f * cos of the lobes that are not Dirac deltas, and the density bsdf_sample has for wi, 1/sr.
vec3 bsdf_evaluate(Surface s, Lobes l, vec3 wi, out float pdf) {
  pdf = 0.0;
  if (!reflects_to(s, wi)) return vec3(0.0);
  const float cos_i = dot(wi, s.normal);
  vec3 value = l.diffuse * (cos_i / PI);
  pdf = l.p_diffuse * (cos_i / PI);
  if (has_feature(FEATURE_GLOSSY) && l.p_reflection > 0.0 && !l.smooth_reflection) {
    const mat3 local = make_frame(s.normal);
    const vec3 o = s.wo * local;
    if (o.z <= 0.0) return value;
    const vec3 i = wi * local;
    const vec3 h = normalize(o + i);
    const float density = ggx_density(h, s.alpha);
    const float lambda_o = ggx_lambda(o, s.alpha);
    const float masking = 1.0 / (1.0 + lambda_o + ggx_lambda(i, s.alpha));
    value += reflection_color(l, dot(o, h)) * (density * masking / (4.0 * o.z));
    pdf += l.p_reflection * density / ((1.0 + lambda_o) * 4.0 * o.z);
  }
  return value;
}

// Smooth interface, both lobes Dirac: reflects with the Fresnel reflectance, else refracts (solid)
// or goes straight through (thin-walled). Radiance is not scaled by the squared ratio of indices:
// light and camera are outside, where the factors of entering and leaving cancel. A solid's colour
// tints on entering only.
bool sample_glass(Surface s, float choice, out vec3 wi, out vec3 weight) {
  const float cos_o = dot(s.normal, s.wo);
  weight = vec3(1.0);
  wi = vec3(0.0);
  if (cos_o <= 0.0) return false;
  const float eta = s.entering || s.thin_walled ? s.ior : 1.0 / s.ior;
  float reflectance = fresnel_dielectric(cos_o, eta);
  if (s.thin_walled) reflectance = 2.0 * reflectance / (1.0 + reflectance);
  if (choice < reflectance) {
    wi = 2.0 * cos_o * s.normal - s.wo;
    return dot(wi, s.geometric_normal) > 0.0;
  }
  if (s.thin_walled || s.entering) weight = s.base_color;
  if (s.thin_walled) {
    wi = -s.wo;
    return true;
  }
  const float cos_t = sqrt(max(0.0, 1.0 - (1.0 - cos_o * cos_o) / (eta * eta)));
  wi = normalize(-s.wo / eta + (cos_o / eta - cos_t) * s.normal);
  return dot(wi, s.geometric_normal) < 0.0;
}

// A direction, the throughput it brings (f * cos / pdf over all non-Dirac lobes, or the Dirac
// lobe's weight), and its density; pdf = 0 says Dirac. False: absorbed.
bool bsdf_sample(Surface s, Lobes l, vec2 u, out vec3 wi, out vec3 weight,
                 out float pdf) {
  pdf = 0.0;
  wi = vec3(0.0);
  weight = vec3(0.0);
  if (choose(u.x, l.p_diffuse)) {
    wi = make_frame(s.normal) * sample_cosine(u);
  } else if (has_feature(FEATURE_TRANSMISSION) && l.p_glass > 0.0 &&
             choose(u.x, l.p_glass / (l.p_glass + l.p_reflection))) {
    if (!sample_glass(s, u.x, wi, weight)) return false;
    weight *= l.glass / l.p_glass;
    return true;
  } else if (has_feature(FEATURE_GLOSSY) && l.p_reflection > 0.0) {
    const float cos_o = dot(s.normal, s.wo);
    if (cos_o <= 0.0) return false;
    if (l.smooth_reflection) {
      wi = 2.0 * cos_o * s.normal - s.wo;
      weight = reflection_color(l, cos_o) / l.p_reflection;
      return reflects_to(s, wi);
    }
    const mat3 local = make_frame(s.normal);
    const vec3 o = s.wo * local;
    const vec3 h = sample_ggx(o, s.alpha, u);
    wi = local * (2.0 * dot(o, h) * h - o);
  } else {
    return false;
  }
  wi = normalize(wi);
  const vec3 value = bsdf_evaluate(s, l, wi, pdf);
  if (pdf <= 0.0) return false;
  weight = value / pdf;
  return true;
}

#endif
