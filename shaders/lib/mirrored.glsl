// Finds what is seen in a mirror or through solid glass, which is the place where a ray ends that they reflect
// or bend, and not their own surface. That place is what moves as its light does (shaders/README.md, "Accumulation over
// time").
#ifndef PREVIZ_MIRRORED_GLSL
#define PREVIZ_MIRRORED_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/trace.glsl"

// A lobe that is wider than this shows no image.
const float MOST_IMAGE_ALPHA = 0.1;
// Light is followed through so many surfaces: those of a hollow glass ball, and a mirror behind it.
const uint MOST_MIRRORS = 5u;
// The environment is taken to be so far away, in metres, where a ray ends in it.
const float FAR_AWAY = 1e7;

// A ray on its way over mirrors.
struct MirroredRay {
  vec3 origin, direction;
  uvec2 source;  // the triangle that it leaves, or TRACE_FROM_NOWHERE
  float alpha;   // the largest on the way
  uint way;      // a hash of which instances it has met, and which have reflected and which bent it
};

// Returns whether a smooth surface shows above all what is elsewhere, and in which direction.
bool shows_elsewhere(Surface s, out vec3 direction) {
  direction = vec3(0.0);
  if (!has_feature(FEATURE_GLOSSY) && !has_feature(FEATURE_TRANSMISSION)) return false;
  const float cos_o = dot(s.normal, s.wo);
  if (!is_specular(s) || s.alpha > MOST_IMAGE_ALPHA || cos_o <= 0.0) return false;
  if (s.metallic > 0.5) {
    direction = 2.0 * cos_o * s.normal - s.wo;
    return reflects_to(s, direction);
  }
  if (!has_feature(FEATURE_TRANSMISSION) || s.thin_walled || (1.0 - s.metallic) * s.transmission < 0.5)
    return false;
  const bool reflected = glass_reflectance(s, cos_o) > 0.5;
  direction = glass_direction(s, s.wo, s.normal, reflected);
  return reflected == (dot(direction, s.geometric_normal) > 0.0);
}

// Returns the ray that goes on from a mirror in this direction.
MirroredRay ray_from_mirror(MirroredRay ray, Surface mirror, Hit hit, vec3 direction) {
  const uint side = uint(dot(direction, mirror.geometric_normal) > 0.0);
  return MirroredRay(offset_origin(mirror, direction), direction, uvec2(hit.instance, hit.primitive),
                     max(ray.alpha, mirror.alpha), hash_pair(ray.way, 2u * hit.instance + side));
}

#endif
