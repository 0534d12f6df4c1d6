// Panes: smooth thin walls of clear material. Light that goes straight through a pane is not bent, so
// that passing it is no event of a path (shaders/README.md, "Panes").
//
// A ray passes a pane with a probability of the least channel of what the pane lets through, as if
// the pane were not there. Only the rest of the rays meets it: they go on as well, in the colour that
// is left, or are reflected.
#ifndef PREVIZ_PANE_GLSL
#define PREVIZ_PANE_GLSL

#include "shaders/lib/bsdf.glsl"

// Returns a hash of the ray and the surface. It is as good as a random number, because no two rays
// are alike, and is the same in both worlds of a ray.
uint hash_meeting(uint instance, uint primitive, vec3 origin, vec3 direction) {
  uint key = hash_pair(instance, primitive);
  key = hash_pair(key, hash_pair(floatBitsToUint(direction.x), floatBitsToUint(direction.y)));
  key = hash_pair(key, hash_pair(floatBitsToUint(direction.z), floatBitsToUint(origin.x)));
  return hash_pair(key, hash_pair(floatBitsToUint(origin.y), floatBitsToUint(origin.z)));
}

// Keys of hash_meeting() for further decisions about the same surface.
const uint KEY_PASSES = 0x68e31da4u;
const uint KEY_PASSES_MET = 0xb5297a4du;

bool may_be_pane(uint material) {
  return material_at(material).thin_walled != 0u && material_at(material).transmission > 0.0;
}

// Returns whether what is behind the surface may be seen through it, unbent.
bool lets_light_through(uint material) {
  return material_at(material).alpha_mode != ALPHA_OPAQUE || may_be_pane(material);
}

// Returns the share of light that goes straight through the surface; 0 where it is no pane.
vec3 pane_transmittance(Surface s) {
  const bool smooth_wall = s.alpha <= frame.specular_alpha || s.ior < LEAST_ROUGH_IOR;
  const float cos_o = dot(s.normal, s.wo);
  const bool coated = (has_feature(FEATURE_CLEARCOAT) && s.clearcoat > 0.0) || has_sheen(s);
  if (!s.thin_walled || !smooth_wall || coated || cos_o <= 0.0) return vec3(0.0);
  const float glass = (1.0 - s.metallic) * s.transmission;
  return clamp(glass * (1.0 - glass_reflectance(s, cos_o)) * s.base_color, 0.0, 1.0);
}

float least_of(vec3 v) { return min(min(v.r, v.g), v.b); }
float largest_of(vec3 v) { return max(max(v.r, v.g), v.b); }

// Decides for a ray that has met a pane whether it passes in the colour that is left. `factor`
// corrects for the probability of either decision; `chance` is a random number.
bool passes_met_pane(vec3 through, float chance, out vec3 factor) {
  const float least = least_of(through);
  const float most = largest_of(through);
  if (chance * (1.0 - least) < most - least) {
    factor = (through - least) / (most - least);
    return true;
  }
  factor = vec3(1.0 / (1.0 - most));
  return false;
}

// Returns the lobes of a surface of which light does not go straight through any more: the glass of a
// pane only reflects.
Lobes without_passing(Surface s, Lobes l, vec3 through) {
  if (l.p_glass <= 0.0 || all(equal(through, vec3(0.0)))) return l;
  const float total = l.glass / l.p_glass;  // by which the probabilities were normalised
  const float reflected = l.glass * glass_reflectance(s, dot(s.normal, s.wo));
  const float left = total - l.glass + reflected;
  const float scale = left > 0.0 ? total / left : 0.0;
  l.p_diffuse *= scale;
  l.p_reflection *= scale;
  l.p_glass = left > 0.0 ? reflected / left : 0.0;
  l.glass = reflected;
  return l;
}

// Samples a direction from the lobes of without_passing(), with the results of bsdf_sample(). Unless
// the pane reflects, only the other lobes are left in `l`, and `others` is the probability that it is
// one of them.
bool sample_met_pane(Surface s, inout Lobes l, vec2 u, float choice, out vec3 wi, out vec3 weight,
                     out bool is_dirac, out float others) {
  others = 1.0 - l.p_glass;
  if (choose(u.x, l.p_glass)) {
    wi = 2.0 * dot(s.normal, s.wo) * s.normal - s.wo;
    weight = vec3(l.glass / l.p_glass);
    is_dirac = true;
    return reflects_to(s, wi);
  }
  l.p_diffuse /= others;
  l.p_reflection /= others;
  l.p_glass = 0.0;
  l.glass = 0.0;
  if (!bsdf_sample(s, l, u, choice, wi, weight, is_dirac)) return false;
  weight /= others;
  return true;
}

#endif
