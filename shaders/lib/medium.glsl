// The insides of coloured glass and liquids, which take light away along its way (Beer-Lambert;
// shaders/README.md, "Coloured glass"). A path or a photon carries the medium that it is in: 0 is
// clear, i + 1 is the inside of material i. Without FEATURE_ATTENUATION everything is clear.
#ifndef PREVIZ_MEDIUM_GLSL
#define PREVIZ_MEDIUM_GLSL

#include "shaders/lib/scene.glsl"

uint path_medium(uint bits) {
  return has_feature(FEATURE_ATTENUATION) ? bits >> PATH_MEDIUM_SHIFT : 0u;
}

// Returns the share of light that is left after a distance in metres.
vec3 medium_transmittance(uint medium, float distance) {
  if (!has_feature(FEATURE_ATTENUATION) || medium == 0u) return vec3(1.0);
  // A finite distance keeps 0 times infinity out of the channels that the medium leaves alone.
  return exp(-material_at(medium - 1u).attenuation * min(distance, 1e37));
}

// Returns the medium of a segment that ends at the surface. A segment that never entered a solid
// and ends at a solid's inner side began inside, as light of a lamp in a coloured bulb does. It may
// also have passed the front where that is transparent by its alpha, and is then taken as clear.
uint medium_before(uint medium, Surface s) {
  if (!has_feature(FEATURE_ATTENUATION) || medium != 0u || s.medium == 0u || s.entering)
    return medium;
  return material_at(s.medium - 1u).alpha_mode == ALPHA_OPAQUE ? s.medium : 0u;
}

// Returns the medium into which a ray leaves the surface.
uint medium_beyond(uint medium, Surface s, vec3 direction) {
  if (!has_feature(FEATURE_ATTENUATION)) return 0u;
  if (s.thin_walled || dot(direction, s.geometric_normal) >= 0.0) return medium;
  if (s.entering) return s.medium;
  return medium == s.medium ? 0u : medium;  // where solids overlap, the other one goes on
}

#endif
