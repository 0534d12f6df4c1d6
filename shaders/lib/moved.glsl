// Estimates how much the light of a surface changes where an instance has moved: by how much of it that
// instance can hide or send. What has moved ends the past of what it reaches, and no more (shaders/README.md,
// "Accumulation over time").
#ifndef PREVIZ_MOVED_GLSL
#define PREVIZ_MOVED_GLSL

#include "shaders/lib/history.glsl"
#include "shaders/lib/light.glsl"

layout(scalar) readonly buffer Moves { GpuMoved moves[]; };
layout(scalar) readonly buffer Arrivals { GpuArrival arrivals[]; };

// A part of the environment with more than this share of the light is taken to come from one point.
const float BRIGHT_SHARE = 0.1;
// What is seen in a smooth surface is a share of its light that nobody has measured. It counts as all.
const float SMOOTH_ALPHA = 0.3;
// Shadows are looked for from so many lamps, which are taken evenly from the list of all.
const uint MOST_LAMPS = 32u;
// What moves is lit by what it moves among, and changes by less than it has moved.
const float OWN_SHARE = 0.2;

// Returns whether a segment meets the sphere.
bool meets_sphere(vec4 sphere, vec3 point, vec3 direction, float t_max) {
  const vec3 off = sphere.xyz - point;
  const float nearest = clamp(dot(off, direction), 0.0, t_max);
  const vec3 beside = off - nearest * direction;
  return dot(beside, beside) <= sphere.w * sphere.w;
}

// Returns the share of the light of a surface that what is in the sphere can hide or send.
float share_of_sphere(vec4 sphere, Surface s) {
  const vec3 off = sphere.xyz - s.position;
  const float distance_2 = dot(off, off);
  const float sin_2 = sphere.w * sphere.w / distance_2;  // of the angle at which the sphere ends
  if (!(sin_2 < 1.0)) return 1.0;
  const vec3 towards = off * inversesqrt(distance_2);
  const float sin_end = sqrt(sin_2), cos_end = sqrt(1.0 - sin_2);
  const float up = dot(towards, s.geometric_normal);
  if (up < -sin_end) return 0.0;
  const float angle = asin(sin_end);
  if (is_specular(s) && s.alpha < SMOOTH_ALPHA) {
    const vec3 mirrored = reflect(-s.wo, s.normal);
    if (s.transmission > 0.0 || acos(clamp(dot(mirrored, towards), -1.0, 1.0)) < angle + s.alpha)
      return 1.0;
  }
  float share = 0.0;
  for (uint i = 0u; i < history.arrival_count; ++i) {
    const GpuArrival a = arrivals[i];
    // Every pixel asks for every direction of light: no angle is computed that its cosine stands for.
    if (dot(a.direction, towards) < cos_end * a.cos_width - sin_end * a.sin_width) continue;
    if (dot(a.direction, s.geometric_normal) < -a.width) continue;
    const float part = min(angle / max(a.width, 1e-6), 1.0);
    share += a.share * (a.share > BRIGHT_SHARE ? 1.0 : part * part);
  }
  const uint lamps = min(frame.light_count, MOST_LAMPS);
  for (uint i = 0u; i < lamps; ++i) {
    const uint lamp = i * frame.light_count / lamps;
    if (placeless_light(lamp).type == LIGHT_DIRECTIONAL) continue;
    const vec3 to_lamp = fetch(light_positions, int(lamp)).xyz - s.position;
    const float distance = length(to_lamp);
    if (meets_sphere(sphere, s.position, to_lamp / max(distance, 1e-30), distance)) return 1.0;
  }
  // It hides light that comes from other surfaces, too, and sends what falls on it.
  return min(share + sin_2 * clamp(up + sin_end, 0.0, 1.0), 1.0);
}

// Returns the share by which the light of a surface of the instance may have changed. `bent` is by which angle
// it has turned there, beside what the whole instance has.
float change_by_moved(Surface s, uint instance, float bent) {
  float change = bent;
  for (uint i = 0u; i < history.moved_count; ++i) {
    const GpuMoved m = moves[i];
    if (m.instance == instance)
      change += m.turn + OWN_SHARE * m.share;
    else
      change += m.share * max(share_of_sphere(m.before, s), share_of_sphere(m.now, s));
  }
  return change;
}

#endif
