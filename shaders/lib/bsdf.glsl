// Scattering at a surface: Lambert, GGX reflection (dielectric coat and conductor), glass, sheen
// and lacquer. The definitions are in tests/truth/README.md, "The model of the reference tracer",
// which an independent CPU tracer follows as well.
#ifndef PREVIZ_BSDF_GLSL
#define PREVIZ_BSDF_GLSL

#include "shaders/lib/albedo_table.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"
#include "shaders/lib/sheen.glsl"

float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }

// Returns the unpolarised Fresnel reflectance of a smooth interface; eta is the index of refraction
// of the far side over that of the near side.
float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1.0) return 1.0;
  const float cos_t = sqrt(1.0 - sin2_t);
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Returns Schlick's approximation (1994) of the Fresnel reflectance.
vec3 fresnel_schlick(vec3 f0, float cos_i) {
  const float m = clamp(1.0 - cos_i, 0.0, 1.0);
  const float m2 = m * m;
  return f0 + (vec3(1.0) - f0) * (m2 * m2 * m);
}

// Returns a uniformly distributed point of the unit disc.
vec2 sample_disc(vec2 u) {
  const float r = sqrt(u.x);
  const float phi = 2.0 * PI * u.y;
  return r * vec2(cos(phi), sin(phi));
}

// Returns a direction around +z with the density cos / pi.
vec3 sample_cosine(vec2 u) {
  const vec2 d = sample_disc(u);
  return vec3(d, sqrt(max(0.0, 1.0 - u.x)));
}

// Returns a direction around +z with the density 1 / (2 pi).
vec3 sample_hemisphere(vec2 u) {
  const float r = sqrt(max(0.0, 1.0 - u.x * u.x));
  const float phi = 2.0 * PI * u.y;
  return vec3(r * cos(phi), r * sin(phi), u.x);
}

// The GGX density of half vectors (Walter et al. 2007), in the local frame whose z is the normal.
// It is written in the half vector's x and y, because 1 - z^2 would cancel close to the normal.
float ggx_density(vec3 h, float alpha) {
  const float a2 = alpha * alpha;
  const float d = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
  return 1.0 / (PI * a2 * d * d);
}
// Smith's lambda of GGX for a direction in the local frame (Heitz 2014).
float ggx_lambda(vec3 w, float alpha) {
  const float tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
  return 0.5 * (sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

// GGX's density of facets whose widths along x and y differ (Heitz 2014, "Anisotropy").
float ggx_density(vec3 h, vec2 alpha) {
  const vec2 slope = h.xy / alpha;
  const float d = dot(slope, slope) + h.z * h.z;
  return 1.0 / (PI * alpha.x * alpha.y * d * d);
}
float ggx_lambda(vec3 w, vec2 alpha) {
  const vec2 stretched = w.xy * alpha;
  return 0.5 * (sqrt(1.0 + dot(stretched, stretched) / (w.z * w.z)) - 1.0);
}

// Returns a half vector distributed as the visible normals are (Dupuy and Benyoub 2023, "Sampling
// Visible GGX Normals with Spherical Caps").
vec3 sample_ggx(vec3 wo, vec2 alpha, vec2 u) {
  const vec3 stretched = normalize(vec3(wo.xy * alpha, wo.z));
  const float phi = 2.0 * PI * u.x;
  const float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
  const float sin_theta = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
  const vec3 cap = vec3(sin_theta * cos(phi), sin_theta * sin(phi), z) + stretched;
  return normalize(vec3(cap.xy * alpha, cap.z));
}

vec3 sample_ggx(vec3 wo, float alpha, vec2 u) { return sample_ggx(wo, vec2(alpha), u); }

// The lobes of a surface seen from wo: their weights, and the probability of sampling each.
struct Lobes {
  vec3 diffuse;         // albedo
  float coat;           // weight of the dielectric reflection, in its strongest channel
  vec3 coat_color;      // the channels' share of it
  vec3 conductor;       // reflectance at normal incidence
  float conductor_weight;
  float conductor_loss; // what single scattering loses, over what it keeps
  float glass;
  float glass_gain;
  vec3 sheen;           // weight of the fibres' reflection
  float below_sheen;    // what fibres on the viewer's side leave for the lobes below them
  float clear;          // weight of the reflection of a coat of lacquer above all else
  float p_diffuse, p_reflection, p_glass, p_sheen, p_clear;
  bool smooth_reflection;  // the reflection is a Dirac delta
  bool smooth_glass;
  bool smooth_clear;
};

// A lobe is rough here if it is not a Dirac delta.
bool has_rough_reflection(Lobes l) { return l.p_reflection > 0.0 && !l.smooth_reflection; }
bool has_rough_glass(Lobes l) { return l.p_glass > 0.0 && !l.smooth_glass; }
bool has_rough_clear(Lobes l) {
  return has_feature(FEATURE_CLEARCOAT) && l.p_clear > 0.0 && !l.smooth_clear;
}
bool has_sheen(Lobes l) { return has_feature(FEATURE_SHEEN) && l.p_sheen > 0.0; }
bool is_rough(Lobes l) {
  return l.p_diffuse > 0.0 || has_rough_reflection(l) || has_rough_glass(l) || has_sheen(l) ||
         has_rough_clear(l);
}

// Lacquer has this index of refraction (KHR_materials_clearcoat).
const float CLEARCOAT_IOR = 1.5;

// Returns the share that lacquer of the weight 1 reflects. It lies on the outside of solid glass, so
// that from inside, too, the direction outside counts: a path that leaves loses what a photon loses
// that enters. Where nothing leaves, all is reflected.
float lacquer_reflectance(Surface s, float cos_o) {
  if (s.transmission > 0.0 && !s.thin_walled && !s.entering)
    cos_o = sqrt(max(0.0, 1.0 - (1.0 - cos_o * cos_o) * s.ior * s.ior));
  return fresnel_dielectric(cos_o, CLEARCOAT_IOR);
}

// Returns the reflectance of a coat of paint or plastic in its strongest channel, and in `color`
// that of every channel over it. The colour is a factor at normal incidence
// (KHR_materials_specular) and fades towards grazing, as Fresnel's reflectance departs from that at
// normal incidence.
float coat_reflectance(Surface s, float cos_o, out vec3 color) {
  const float white = fresnel_dielectric(cos_o, s.ior);
  color = vec3(1.0);
  if (!has_coat_color(s)) return s.specular * white;
  const float root = (s.ior - 1.0) / (s.ior + 1.0);
  const float f0 = root * root;
  const float towards_white = max((white - f0) / (1.0 - f0), 0.0);
  const vec3 colored = mix(min(f0 * s.specular_color, vec3(1.0)), vec3(1.0), towards_white);
  const float strongest = max(max(colored.r, colored.g), colored.b);
  if (strongest > 0.0) color = colored / strongest;
  return s.specular * strongest;
}

// Returns the share of light that the reflection of a conductor with the reflectance 1 keeps, seen
// from wo.
float reflection_albedo(Surface s, float cos_o) {
  if (!is_anisotropic(s)) return single_scatter_albedo(0u, cos_o, s.alpha);
  const vec2 across = vec2(dot(s.tangent, s.wo), dot(cross(s.normal, s.tangent), s.wo));
  if (!has_feature(FEATURE_LAYER_TEXTURES) || s.anisotropy_step < 0.0)
    return anisotropic_albedo(s.albedo_table, across, cos_o, s.alpha);
  // A texture gives the strength: the tables of the steps around it count.
  const float low = min(floor(s.anisotropy_step), float(ANISOTROPIC_STEPS - 1u));
  const uint above = s.albedo_table + uint(low) * ANISOTROPIC_TABLES;
  const float weaker = low > 0.0
                           ? anisotropic_albedo(above - ANISOTROPIC_TABLES, across, cos_o, s.alpha)
                           : single_scatter_albedo(0u, cos_o, s.alpha);
  return mix(weaker, anisotropic_albedo(above, across, cos_o, s.alpha), s.anisotropy_step - low);
}

// The p_* sum to 1, in proportion to the lobes' luminance, or are all 0 on a black surface.
Lobes make_lobes(Surface s) {
  Lobes l;
  const float nv = abs(dot(s.normal, s.wo));
  const float opaque = (1.0 - s.metallic) * (1.0 - s.transmission);
  l.coat = 0.0;
  l.coat_color = vec3(1.0);
  l.conductor = vec3(0.0);
  l.conductor_weight = 0.0;
  l.conductor_loss = 0.0;
  l.smooth_reflection = false;
  l.smooth_glass = true;
  l.glass_gain = 1.0;
  float reflection = 0.0;
  if (has_feature(FEATURE_GLOSSY)) {
    if (opaque > 0.0 && s.specular > 0.0) l.coat = coat_reflectance(s, nv, l.coat_color);
    l.conductor_weight = s.metallic;
    l.conductor = s.base_color;
    l.smooth_reflection = s.tangent_alpha <= frame.specular_alpha;
    reflection = opaque * l.coat;
    if (has_coat_color(s)) reflection *= luminance(l.coat_color);
    if (s.metallic > 0.0) {
      reflection += s.metallic * luminance(fresnel_schlick(s.base_color, nv));
      if (!l.smooth_reflection) l.conductor_loss = 1.0 / reflection_albedo(s, nv) - 1.0;
    }
  }
  l.diffuse = opaque * (1.0 - l.coat) * s.base_color;
  l.coat *= opaque;
  l.glass = has_feature(FEATURE_TRANSMISSION) ? (1.0 - s.metallic) * s.transmission : 0.0;
  if (has_feature(FEATURE_TRANSMISSION) && l.glass > 0.0) {
    l.smooth_glass = s.alpha <= frame.specular_alpha || s.ior < LEAST_ROUGH_IOR;
    const uint table = s.thin_walled ? 0u : s.albedo_table + (s.entering ? 0u : 1u);
    if (!l.smooth_glass) l.glass_gain = 1.0 / single_scatter_albedo(table, nv, s.alpha);
  }
  l.sheen = vec3(0.0);
  l.below_sheen = 1.0;
  float sheen = 0.0;
  if (has_sheen_towards(s, s.wo)) {
    l.below_sheen = left_by_sheen(s, s.wo);
    const float share = sheen_albedo(s, nv);
    // Behind the plane of the shading normal only Lambert's lobe is left.
    if (dot(s.normal, s.wo) > 0.0) l.sheen = s.sheen_color / max(share, 1.0);
    sheen = luminance(l.sheen) * share;
  }
  l.clear = 0.0;
  l.smooth_clear = false;
  if (has_feature(FEATURE_CLEARCOAT) && s.clearcoat > 0.0) {
    l.clear = s.clearcoat * lacquer_reflectance(s, abs(dot(lacquer_normal(s), s.wo)));
    l.smooth_clear = s.clearcoat_alpha <= frame.specular_alpha;
    // What the lacquer does not reflect is left for what is below it.
    const float below = 1.0 - l.clear;
    l.diffuse *= below;
    l.coat *= below;
    l.conductor_weight *= below;
    l.glass *= below;
    l.sheen *= below;
    sheen *= below;
    reflection *= below;
  }
  const float diffuse = luminance(l.diffuse);
  float base = diffuse + reflection + l.glass;
  if (has_feature(FEATURE_SHEEN)) base *= l.below_sheen;
  float total = base;
  if (has_feature(FEATURE_SHEEN)) total += sheen;
  if (has_feature(FEATURE_CLEARCOAT)) total += l.clear;
  const float scale = total > 0.0 ? 1.0 / total : 0.0;
  const float base_scale = has_feature(FEATURE_SHEEN) ? l.below_sheen * scale : scale;
  l.p_clear = l.clear * scale;
  l.p_sheen = sheen * scale;
  l.p_diffuse = diffuse * base_scale;
  l.p_reflection = reflection * base_scale;
  l.p_glass = l.glass * base_scale;
  return l;
}

// Returns the colour of the reflection, coat and conductor together, for this cosine between the
// half vector and the light.
vec3 reflection_color(Lobes l, float cos_half) {
  const vec3 coat = has_feature(FEATURE_COAT_COLOR) ? l.coat * l.coat_color : vec3(l.coat);
  const vec3 gain = 1.0 + l.conductor * l.conductor_loss;  // returns what is lost
  return coat + l.conductor_weight * gain * fresnel_schlick(l.conductor, cos_half);
}

// Returns the colour of all reflections that are Dirac deltas and follow the base's normal: that of
// lacquer is among them unless it has a normal of its own.
vec3 mirror_color(Lobes l, float cos_o) {
  vec3 color = l.smooth_reflection ? reflection_color(l, cos_o) : vec3(0.0);
  if (has_feature(FEATURE_SHEEN)) color *= l.below_sheen;
  const bool clear = has_feature(FEATURE_CLEARCOAT) && !has_clear_normal() && l.smooth_clear;
  return clear ? color + l.clear : color;
}

// Returns the probability with which bsdf_sample() chooses a reflection that is a Dirac delta.
float mirror_probability(Lobes l) {
  const float base = l.smooth_reflection ? l.p_reflection : 0.0;
  return has_feature(FEATURE_CLEARCOAT) && l.smooth_clear ? base + l.p_clear : base;
}
// Returns the share of that which is the lacquer's, where it has a normal of its own.
float clear_mirror_share(Lobes l) {
  return has_clear_normal() && l.smooth_clear && l.p_clear > 0.0 ? l.p_clear / mirror_probability(l)
                                                                 : 0.0;
}

// A reflected direction counts only if it is above both the surface and the plane of the shading
// normal of what reflects.
bool reflects_to(Surface s, vec3 wi, vec3 normal) {
  return dot(wi, s.geometric_normal) > 0.0 && dot(wi, normal) > 0.0;
}
bool reflects_to(Surface s, vec3 wi) { return reflects_to(s, wi, s.normal); }

// Returns the index of refraction behind the surface over the one in front of it.
float relative_ior(Surface s) { return s.entering || s.thin_walled ? s.ior : 1.0 / s.ior; }

// Returns the share that glass reflects; the rest passes. In a thin pane light is also reflected
// back and forth between its two sides: R' = 2 R / (1 + R).
float glass_reflectance(Surface s, float cos_o) {
  const float once = fresnel_dielectric(cos_o, relative_ior(s));
  return s.thin_walled ? 2.0 * once / (1.0 + once) : once;
}

// The colour of a solid tints light on entering only, so that crossing it tints once, as a pane
// does.
vec3 glass_tint(Surface s) { return s.thin_walled || s.entering ? s.base_color : vec3(1.0); }

// Adds f * cos and the density of rough glass for a direction i behind the surface (Walter et al.
// 2007, equation 21); o and i are in the local frame. A thin pane transmits the mirror image of
// what it would reflect.
void add_transmission(Surface s, Lobes l, vec3 o, vec3 i, inout vec3 value, inout float pdf) {
  const float eta = relative_ior(s);
  vec3 h = s.thin_walled ? normalize(o + vec3(i.xy, -i.z)) : normalize(o + eta * i);
  if (h.z < 0.0) h = -h;
  const float oh = dot(o, h);
  const float ih = dot(i, h);
  if (oh <= 0.0 || (!s.thin_walled && ih >= 0.0)) return;
  // The spread is the solid angle of half vectors over that of directions (ibid., equation 17).
  const float bend = oh + eta * ih;
  const float spread = s.thin_walled ? 1.0 / (4.0 * oh) : eta * eta * -ih / (bend * bend);
  const float through = 1.0 - glass_reflectance(s, oh);
  const float density = ggx_density(h, s.alpha) * oh / o.z * spread * through;
  const float lambda_o = ggx_lambda(o, s.alpha);
  value += l.glass * l.glass_gain * glass_tint(s) *
           (density / (1.0 + lambda_o + ggx_lambda(i, s.alpha)));
  pdf += l.p_glass * density / (1.0 + lambda_o);
}

// The local frame of the lobes: an anisotropic reflection is wider along its x.
mat3 lobe_frame(Surface s) {
  if (!is_anisotropic(s)) return make_frame(s.normal);
  return mat3(s.tangent, cross(s.normal, s.tangent), s.normal);
}
vec2 lobe_widths(Surface s) { return vec2(s.tangent_alpha, s.alpha); }

float reflection_density(Surface s, vec3 h) {
  return is_anisotropic(s) ? ggx_density(h, lobe_widths(s)) : ggx_density(h, s.alpha);
}
float reflection_lambda(Surface s, vec3 w) {
  return is_anisotropic(s) ? ggx_lambda(w, lobe_widths(s)) : ggx_lambda(w, s.alpha);
}

// Adds f * cos and the density of the rough reflection of coat, conductor and glass together.
void add_reflection(Surface s, Lobes l, vec3 o, vec3 i, inout vec3 value, inout float pdf) {
  const vec3 h = normalize(o + i);
  const float oh = dot(o, h);
  vec3 color = vec3(0.0);
  float probability = 0.0;
  if (has_feature(FEATURE_GLOSSY) && has_rough_reflection(l)) {
    color = reflection_color(l, oh);
    probability = l.p_reflection;
  }
  if (has_feature(FEATURE_TRANSMISSION) && has_rough_glass(l)) {
    const float reflectance = glass_reflectance(s, oh);
    color += l.glass * l.glass_gain * reflectance;
    probability += l.p_glass * reflectance;
  }
  const float density = reflection_density(s, h) / (4.0 * o.z);
  const float lambda_o = reflection_lambda(s, o);
  value += color * (density / (1.0 + lambda_o + reflection_lambda(s, i)));
  pdf += probability * density / (1.0 + lambda_o);
}

// Adds f * cos and the density of sheen.
void add_sheen(Surface s, Lobes l, vec3 wi, inout vec3 value, inout float pdf) {
  value += l.sheen * (sheen_value(s, wi) / max(sheen_albedo(s, dot(wi, s.normal)), 1.0));
  pdf += l.p_sheen / (2.0 * PI);
}

// Returns the lobes with what sheen leaves of them for light from wi. Both directions count alike,
// so that photons lose what paths lose.
Lobes under_sheen(Surface s, Lobes l, vec3 wi) {
  const float left = min(l.below_sheen, left_by_sheen(s, wi));
  l.diffuse *= left;
  l.coat *= left;
  l.conductor_weight *= left;
  l.glass *= left;
  return l;
}

// Adds f * cos and the density of rough lacquer.
void add_clearcoat(Surface s, Lobes l, vec3 o, vec3 i, inout vec3 value, inout float pdf) {
  const float alpha = s.clearcoat_alpha;
  const float density = ggx_density(normalize(o + i), alpha) / (4.0 * o.z);
  const float lambda_o = ggx_lambda(o, alpha);
  value += l.clear * density / (1.0 + lambda_o + ggx_lambda(i, alpha));
  pdf += l.p_clear * density / (1.0 + lambda_o);
}

// Returns f * cos of all lobes that are not Dirac deltas, and in `pdf` the density per steradian
// with which bsdf_sample() chooses wi among them.
vec3 bsdf_evaluate(Surface s, Lobes l, vec3 wi, out float pdf) {
  pdf = 0.0;
  vec3 value = vec3(0.0);
  const bool reflects = reflects_to(s, wi);
  if (has_sheen(s)) l = under_sheen(s, l, wi);
  if (reflects) {
    const float cos_i = dot(wi, s.normal);
    value = l.diffuse * (cos_i / PI);
    pdf = l.p_diffuse * (cos_i / PI);
  }
  if (reflects && has_sheen(l)) add_sheen(s, l, wi, value, pdf);
  const bool glass = has_feature(FEATURE_TRANSMISSION) && has_rough_glass(l);
  const bool base = glass || (has_feature(FEATURE_GLOSSY) && has_rough_reflection(l));
  if (!base && !has_rough_clear(l)) return value;
  if (has_clear_normal() && has_rough_clear(l) && reflects_to(s, wi, s.clear_normal)) {
    const mat3 clear = make_frame(s.clear_normal);
    const vec3 o = s.wo * clear;
    if (o.z > 0.0) add_clearcoat(s, l, o, wi * clear, value, pdf);
  }
  const mat3 local = lobe_frame(s);
  const vec3 o = s.wo * local;
  if (o.z <= 0.0) return value;
  if (!has_clear_normal() && reflects && has_rough_clear(l))
    add_clearcoat(s, l, o, wi * local, value, pdf);
  if (reflects && base)
    add_reflection(s, l, o, wi * local, value, pdf);
  else if (glass && dot(wi, s.geometric_normal) < 0.0 && dot(wi, s.normal) < 0.0)
    add_transmission(s, l, o, wi * local, value, pdf);
  return value;
}

// Returns the direction in which light from wo leaves a facet of glass with the normal m: it is
// reflected, or refracted by a solid, or continues straight through a thin wall.
vec3 glass_direction(Surface s, vec3 wo, vec3 m, bool reflected) {
  const float cos_o = dot(m, wo);
  if (reflected) return 2.0 * cos_o * m - wo;
  if (s.thin_walled) return -wo;
  const float eta = relative_ior(s);
  const float cos_t = sqrt(max(0.0, 1.0 - (1.0 - cos_o * cos_o) / (eta * eta)));
  return normalize(-wo / eta + (cos_o / eta - cos_t) * m);
}

// Samples a smooth interface, whose two lobes are Dirac deltas: it reflects with a probability of
// the Fresnel reflectance and transmits otherwise. Radiance is not scaled by the squared ratio of
// indices: light and camera are outside, where the factors of entering and leaving cancel.
bool sample_glass(Surface s, float choice, out vec3 wi, out vec3 weight) {
  const float cos_o = dot(s.normal, s.wo);
  weight = vec3(1.0);
  wi = vec3(0.0);
  if (cos_o <= 0.0) return false;
  const bool reflected = choice < glass_reflectance(s, cos_o);
  wi = glass_direction(s, s.wo, s.normal, reflected);
  if (!reflected) weight = glass_tint(s);
  return reflected == (dot(wi, s.geometric_normal) > 0.0);
}

// Samples a direction of rough glass by a visible facet; `choice` decides between reflection and
// transmission. It returns false if the direction ends on the wrong side, where another facet
// blocks it.
bool sample_rough_glass(Surface s, float choice, vec2 u, out vec3 wi) {
  const mat3 local = make_frame(s.normal);
  const vec3 o = s.wo * local;
  const vec3 h = sample_ggx(o, s.alpha, u);
  const bool reflected = choice < glass_reflectance(s, max(dot(o, h), 0.0));
  vec3 i = glass_direction(s, o, h, reflected);
  if (s.thin_walled && !reflected) {  // scattered as the reflection, mirrored
    i = 2.0 * dot(o, h) * h - o;
    i.z = -i.z;
  }
  wi = local * i;
  return reflected == (i.z > 0.0);
}

// Samples the direction of a lobe. `weight` is the throughput of a Dirac lobe; that of the others is
// f * cos / pdf of bsdf_evaluate(). `choice` decides whether rough glass reflects. The result is false
// where the light is absorbed.
bool bsdf_sample(Surface s, Lobes l, vec2 u, float choice, out vec3 wi, out vec3 weight,
                 out bool is_dirac) {
  is_dirac = false;
  wi = vec3(0.0);
  weight = vec3(0.0);
  if (choose(u.x, l.p_diffuse)) {
    wi = make_frame(s.normal) * sample_cosine(u);
  } else if (has_sheen(l) &&
             choose(u.x, l.p_sheen / (l.p_sheen + l.p_clear + l.p_glass + l.p_reflection))) {
    wi = make_frame(s.normal) * sample_hemisphere(u);
  } else if (has_feature(FEATURE_CLEARCOAT) && l.p_clear > 0.0 &&
             choose(u.x, l.p_clear / (l.p_clear + l.p_glass + l.p_reflection))) {
    const vec3 normal = lacquer_normal(s);
    const float cos_o = dot(normal, s.wo);
    if (cos_o <= 0.0) return false;
    if (l.smooth_clear) {
      is_dirac = true;
      wi = 2.0 * cos_o * normal - s.wo;
      weight = vec3(l.clear / l.p_clear);
      return reflects_to(s, wi, normal);
    }
    const mat3 local = make_frame(normal);
    const vec3 o = s.wo * local;
    const vec3 h = sample_ggx(o, s.clearcoat_alpha, u);
    wi = local * (2.0 * dot(o, h) * h - o);
  } else if (has_feature(FEATURE_TRANSMISSION) && l.p_glass > 0.0 &&
             choose(u.x, l.p_glass / (l.p_glass + l.p_reflection))) {
    if (l.smooth_glass) {
      is_dirac = true;
      if (!sample_glass(s, u.x, wi, weight)) return false;
      if (has_sheen(s)) l = under_sheen(s, l, wi);
      weight *= l.glass / l.p_glass;
      return true;
    }
    if (dot(s.normal, s.wo) <= 0.0 || !sample_rough_glass(s, choice, u, wi)) return false;
  } else if (has_feature(FEATURE_GLOSSY) && l.p_reflection > 0.0) {
    const float cos_o = dot(s.normal, s.wo);
    if (cos_o <= 0.0) return false;
    if (l.smooth_reflection) {
      is_dirac = true;
      wi = 2.0 * cos_o * s.normal - s.wo;
      weight = reflection_color(l, cos_o) / l.p_reflection;
      if (has_feature(FEATURE_SHEEN)) weight *= l.below_sheen;
      return reflects_to(s, wi);
    }
    const mat3 local = lobe_frame(s);
    const vec3 o = s.wo * local;
    const vec3 h = sample_ggx(o, lobe_widths(s), u);
    wi = local * (2.0 * dot(o, h) * h - o);
  } else {
    return false;
  }
  wi = normalize(wi);
  return true;
}

#endif
