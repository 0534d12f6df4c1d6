// Photons leave the lights towards the bounds of the objects that can reflect or refract without
// blur; others could not make a caustic (shaders/README.md, "Caustics").
#ifndef PREVIZ_PHOTON_EMISSION_GLSL
#define PREVIZ_PHOTON_EMISSION_GLSL

#include "shaders/lib/environment.glsl"
#include "shaders/lib/light.glsl"
#include "shaders/lib/photon.glsl"

// The centre and the radius of each object that is not in both worlds, then of each object that can
// reflect without blur.
PREVIZ_FETCHED(vec4, bounds)

struct Emission {
  vec3 origin;
  vec3 direction;
  vec3 flux;  // watts: radiance, intensity or irradiance over the sample's density
  Gain gain;
};

vec4 specular_bound(uint i) { return fetch(bounds, int(frame.bound_count + i)); }

// Returns 1 - cos of the half angle under which a bound is seen; from inside it is the whole
// sphere's, 2.
float aim_cap(vec4 bound, vec3 origin) {
  const vec3 to_center = bound.xyz - origin;
  const float distance_squared = dot(to_center, to_center);
  return distance_squared > bound.w * bound.w ? sphere_cap(bound.w, distance_squared) : 2.0;
}

// Returns a direction from a place towards the bounds, which are chosen in proportion to their
// solid angle. Each cone that contains the direction adds 1 / (2 pi times the sum of the caps) to
// its density per steradian.
vec3 aim_from(vec3 origin, float choice, vec2 u, out float pdf) {
  float total = 0.0;
  for (uint i = 0u; i < frame.specular_bound_count; ++i) total += aim_cap(specular_bound(i), origin);
  float rest = choice * total;
  uint chosen = 0u;
  for (; chosen + 1u < frame.specular_bound_count; ++chosen) {
    rest -= aim_cap(specular_bound(chosen), origin);
    if (rest < 0.0) break;
  }
  const vec4 bound = specular_bound(chosen);
  const vec3 to_bound = bound.xyz - origin;
  const vec3 axis = dot(to_bound, to_bound) > 0.0 ? normalize(to_bound) : vec3(0.0, 0.0, 1.0);
  const vec3 direction = sample_cone(axis, aim_cap(bound, origin), u);
  float cones = 0.0;
  for (uint i = 0u; i < frame.specular_bound_count; ++i) {
    const vec3 to_center = specular_bound(i).xyz - origin;
    const float along = dot(to_center, direction);
    const vec3 off = to_center - along * direction;
    const float radius_squared = specular_bound(i).w * specular_bound(i).w;
    const bool inside = dot(to_center, to_center) <= radius_squared;
    if (i == chosen || inside || (along > 0.0 && dot(off, off) <= radius_squared)) cones += 1.0;
  }
  pdf = cones / (2.0 * PI * total);
  return direction;
}

// Returns a point in front of the scene from which distant light reaches the bounds, and in `area`
// the inverse of the point's density: each bound's disc that contains the point adds 1 / (sum of
// the areas) to it.
vec3 aim_along(vec3 to_light, float choice, vec2 u, out float area) {
  float total = 0.0;
  for (uint i = 0u; i < frame.specular_bound_count; ++i)
    total += specular_bound(i).w * specular_bound(i).w;
  float rest = choice * total;
  uint chosen = 0u;
  for (; chosen + 1u < frame.specular_bound_count; ++chosen) {
    rest -= specular_bound(chosen).w * specular_bound(chosen).w;
    if (rest < 0.0) break;
  }
  const vec4 bound = specular_bound(chosen);
  const vec2 disc = bound.w * sample_disc(u);
  const mat3 local = make_frame(to_light);
  const vec3 at = bound.xyz + local[0] * disc.x + local[1] * disc.y;
  float discs = 0.0;
  for (uint i = 0u; i < frame.specular_bound_count; ++i) {
    const vec3 to_center = specular_bound(i).xyz - at;
    const vec3 off = to_center - dot(to_center, to_light) * to_light;
    if (i == chosen || dot(off, off) <= specular_bound(i).w * specular_bound(i).w) discs += 1.0;
  }
  area = PI * total / discs;
  return at + to_light * (dot(frame.scene_center - at, to_light) + frame.scene_radius);
}

Emission emit_environment(Sampler random, vec2 choice) {
  float pdf;
  float area;
  const vec3 to_light = environment_sample(sample_2d(random, PAIR_ON_LIGHT), pdf);
  const vec3 origin = aim_along(to_light, choice.y, sample_2d(random, PAIR_AIM), area);
  return Emission(origin, -to_light, environment_radiance(to_light) * (area / pdf), EQUAL_GAIN);
}

Emission emit_directional(GpuLight light, Sampler random, vec2 choice) {
  vec3 to_light = -light.direction;
  vec3 flux = light.emission;
  if (light.cone_sr > 0.0) {
    to_light = sample_cone(to_light, light.cone_sr / (2.0 * PI), sample_2d(random, PAIR_ON_LIGHT));
    flux *= light.cone_sr;
  }
  float area;
  const vec3 origin = aim_along(to_light, choice.y, sample_2d(random, PAIR_AIM), area);
  return Emission(origin, -to_light, flux * area, gain_of(light));
}

// Emits from a point of a light's surface; a two-sided light emits on the side of the direction.
Emission emit_surface(GpuLight light, Sampler random, vec2 choice, vec3 at, vec3 normal, float area,
                      bool two_sided, vec3 radiance) {
  float pdf;
  const vec3 direction = aim_from(at, choice.y, sample_2d(random, PAIR_AIM), pdf);
  float cosine = dot(direction, normal);
  const vec3 side = cosine < 0.0 ? -normal : normal;
  cosine = two_sided ? abs(cosine) : max(cosine, 0.0);
  const vec3 reach = abs(at) + abs(light.edge_u) + abs(light.edge_v);
  const float clear = 1e-6 * (reach.x + reach.y + reach.z);
  return Emission(at + clear * side, direction, radiance * (cosine * area / pdf),
                  gain_of(light));
}

Emission emit_light(GpuLight light, Sampler random, vec2 choice) {
  const vec2 u = sample_2d(random, PAIR_ON_LIGHT);
  switch (light.type) {
    case LIGHT_POINT:
    case LIGHT_SPOT: {
      float pdf;
      const vec3 direction = aim_from(light.position, choice.y, sample_2d(random, PAIR_AIM), pdf);
      const float falloff = spot_falloff(light, dot(direction, light.direction));
      return Emission(light.position, direction, light.emission * (falloff / pdf),
                      gain_of(light));
    }
    case LIGHT_DIRECTIONAL:
      return emit_directional(light, random, choice);
    case LIGHT_SPHERE: {
      const vec3 normal = sample_cone(vec3(0.0, 0.0, 1.0), 2.0, u);
      return emit_surface(light, random, choice, light.position + light.radius * normal, normal,
                          4.0 * PI * light.radius * light.radius, false, light.emission);
    }
    case LIGHT_RECTANGLE:
      return emit_surface(light, random, choice,
                          light.position + (u.x - 0.5) * light.edge_u + (u.y - 0.5) * light.edge_v,
                          light.direction, length(light.edge_u) * length(light.edge_v), false,
                          light.emission);
    default: {  // LIGHT_TRIANGLE
      const float root = sqrt(u.x);
      const vec2 b = vec2(1.0 - root, u.y * root);
      return emit_surface(light, random, choice,
                          light.position + b.x * light.edge_u + b.y * light.edge_v, light.direction,
                          0.5 * length(cross(light.edge_u, light.edge_v)), true,
                          triangle_emission(light, b));
    }
  }
}

// Emits from the environment or from a light; they are chosen in proportion to their power.
Emission emit_photon(Sampler random) {
  vec2 choice = sample_2d(random, PAIR_EMITTER);
  const float environment = frame.photon_environment;
  Emission e;
  float selection;
  if (choose(choice.x, environment)) {
    e = emit_environment(random, choice);
    selection = environment;
  } else {
    const uint index = pick_light(choice.x, false);
    e = emit_light(light_at(index), random, choice);
    selection = (1.0 - environment) * placeless_light(index).selection;
  }
  e.flux /= selection;
  return e;
}

#endif
