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

struct Mirrored {
  Surface surface;  // where the ray ends; the last mirror if it ends nowhere
  Hit hit;          // of the surface
  bool is_far;      // it ends in the environment
  vec3 position;    // from the camera
  vec3 normal;      // unit
  float alpha;      // the largest on the way
  uint way;         // a hash of which instances it has met, and which have reflected and which bent it
  bool is_clear;    // false: it meets something that lets light through unbent, or too many mirrors
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

// Follows a ray that leaves a mirror until it ends at something else.
Mirrored follow_mirrors(Surface s, Hit hit, vec3 direction) {
  Mirrored m = Mirrored(s, hit, false, vec3(0.0), vec3(0.0), 0.0, 0u, true);
  for (uint i = 0u; i < MOST_MIRRORS; ++i) {
    m.alpha = max(m.alpha, m.surface.alpha);
    m.way = hash_pair(m.way, 2u * hit.instance + uint(dot(direction, m.surface.geometric_normal) > 0.0));
    if (!trace_closest(offset_origin(m.surface, direction), direction, 0.0, 3.4e38, WORLD_MIXED,
                       uvec2(hit.instance, hit.primitive), hit)) {
      m.is_far = true;
      m.position = FAR_AWAY * direction;
      m.normal = -direction;
      return m;
    }
    m.hit = hit;
    m.surface = make_surface(GpuHit(hit.t, hit.barycentrics, hit.instance, hit.primitive), direction, 0.0);
    m.position = m.surface.position;
    m.normal = m.surface.geometric_normal;
    if (lets_light_through(instances[hit.instance].material)) break;
    if (!shows_elsewhere(m.surface, direction)) return m;
  }
  m.is_clear = false;
  return m;
}

#endif
