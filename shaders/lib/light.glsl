// Lights with a place or a direction of their own: the lamps of the set and emissive triangles.
#ifndef PREVIZ_LIGHT_GLSL
#define PREVIZ_LIGHT_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/light_tree.glsl"
#include "shaders/lib/path.glsl"

PREVIZ_FETCHED(uvec4, lights)          // LIGHT_TEXELS a GpuLight
PREVIZ_FETCHED(vec4, light_positions)  // of each light

// Returns a light without its position.
const int LIGHT_TEXELS = 10;
GpuLight placeless_light(uint index) {
  PREVIZ_FETCH_RECORD(lights, LIGHT_TEXELS, index, t, f)
  return GpuLight(f[0].xyz, t[0].w, f[1].xyz, f[1].w, f[2].xyz, f[2].w, f[3].xyz, f[3].w, f[4].xyz, f[4].w,
                  f[5].xyz, f[5].w, f[6].xyz, f[6].w, f[7].xy, f[7].zw, f[8].xy, t[8].z, t[8].w, t[9].x, t[9].y,
                  f[9].z, f[9].w);
}

GpuLight light_at(uint index) {
  GpuLight light = placeless_light(index);
  light.position = fetch(light_positions, int(index)).xyz;
  return light;
}

Gain gain_of(GpuLight light) { return Gain(light.gain_mixed, light.gain_real); }

struct LightSample {
  vec3 direction;  // unit, from the point towards the light
  float t_max;     // only a nearer surface blocks the light
  vec3 radiance;   // Le; for a delta light its irradiance on a plane that faces it
  float pdf;       // per steradian; 0 for a delta light
  Gain gain;
};

// A shadow ray ends at this share of the distance, so that it does not meet the light's own
// surface.
const float SHADOW_END = 0.9999;

// The probability that a light or one before it is picked: among all lights, or among what the tree
// of lamps leaves to be picked without it.
float cdf_of(uint index, bool beside_tree) {
  return beside_tree ? placeless_light(index).rest_cdf : placeless_light(index).cdf;
}

// Picks a light by cdf_of(); the rest of u is stretched to [0, 1).
uint pick_light(inout float u, bool beside_tree) {
  uint low = 0u;
  uint high = frame.light_count - 1u;
  while (low < high) {
    const uint middle = (low + high) >> 1;
    if (u < cdf_of(middle, beside_tree)) high = middle;
    else low = middle + 1u;
  }
  const float below = low > 0u ? cdf_of(low - 1u, beside_tree) : 0.0;
  u = clamp((u - below) / max(cdf_of(low, beside_tree) - below, 1e-30), 0.0, 0.99999994);
  return low;
}

bool has_tree() { return has_feature(FEATURE_MANY_LIGHTS) && frame.tree_share > 0.0; }

// Returns the probability with which a light sample for a receiver picks this light among all.
float light_selection(GpuLight light, Receiver r) {
  if (!has_tree()) return light.selection;
  float probability = 0.0;
  if (light.leaf != NO_INDEX) descend_tree(r, light.leaf, 0.0, 0.0, probability);
  return light.rest_selection + frame.tree_share * probability;
}

// Picks a light for a receiver among many, by random numbers of their own. Returns NO_INDEX if none
// shines there. One descent serves both those that take the tree and those that ask it for the
// probability of the lamp that they have.
uint select_light(Receiver r, vec2 lamp, out float selection) {
  const bool by_tree = choose(lamp.x, frame.tree_share);
  const uint picked = by_tree ? NO_INDEX : pick_light(lamp.y, true);
  const uint wanted = by_tree ? NO_INDEX : placeless_light(picked).leaf;
  float probability = 0.0;
  uint found = NO_INDEX;
  if (by_tree || wanted != NO_INDEX)
    found = descend_tree(r, wanted, lamp.y, lamp.x * 5.9604645e-8, probability);
  const uint index = by_tree ? found : picked;
  selection = frame.tree_share * probability;
  if (index != NO_INDEX) selection += placeless_light(index).rest_selection;
  return index;
}

// Returns 1 - cos of the half angle under which a sphere is seen, without cancellation.
float sphere_cap(float radius, float distance_squared) {
  const float sin2 = radius * radius / distance_squared;
  return sin2 / (1.0 + sqrt(max(0.0, 1.0 - sin2)));
}

// Returns a uniformly distributed direction of the cone around `axis`; cap is 1 - cos of its half
// angle.
vec3 sample_cone(vec3 axis, float cap, vec2 u) {
  const float depth = u.x * cap;  // 1 - cos, which for small cones would be lost in cos
  const float sin_theta = sqrt(depth * (2.0 - depth));
  const float phi = 2.0 * PI * u.y;
  // A driver's sine and cosine may be off by 2^-11, which turns the direction about the axis but must
  // not change its length.
  return normalize(make_frame(axis) * vec3(sin_theta * cos(phi), sin_theta * sin(phi), 1.0 - depth));
}

// Returns the distance along a unit ray to a sphere that is seen from outside, below 0 if it is
// missed.
float intersect_sphere(vec3 origin, vec3 direction, vec3 center, float radius) {
  const vec3 to_center = center - origin;
  const float along = dot(to_center, direction);
  const vec3 off = to_center - along * direction;
  const float under = radius * radius - dot(off, off);
  if (under < 0.0 || dot(to_center, to_center) < radius * radius) return -1.0;
  return along - sqrt(under);
}

// Returns the share of a spot's intensity at this angle: a smoothstep between its two cones.
float spot_falloff(GpuLight light, float cos_angle) {
  if (light.type != LIGHT_SPOT) return 1.0;
  const float x = clamp((cos_angle - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-6),
                        0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// Returns the radiance at a point of an emissive triangle, textured and weakened by its alpha.
vec3 triangle_emission(GpuLight light, vec2 b) {
  const vec2 uv = light.uv0 * (1.0 - b.x - b.y) + light.uv1 * b.x + light.uv2 * b.y;
  vec3 emission = light.emission;
  if (has_feature(FEATURE_TEXTURES) && light.emission_texture != NO_INDEX)
    emission *= sample_texture(light.emission_texture, uv).rgb;
  if (has_feature(FEATURE_ALPHA) && light.alpha_instance != NO_INDEX)
    emission *= coverage(light.alpha_instance, light.alpha_primitive, b);
  return emission;
}

// Completes `result` for a uniformly chosen point of a light's surface; false if its front faces
// away.
bool sample_area(GpuLight light, vec3 point, vec3 on_light, vec3 normal, float area,
                 bool two_sided, inout LightSample result) {
  const vec3 to_light = on_light - point;
  const float distance_squared = dot(to_light, to_light);
  if (distance_squared <= 0.0) return false;
  const float distance = sqrt(distance_squared);
  result.direction = to_light / distance;
  result.t_max = distance * SHADOW_END;
  float cos_light = -dot(result.direction, normal);
  if (two_sided) cos_light = abs(cos_light);
  if (cos_light <= 0.0 || area <= 0.0) return false;
  result.pdf = distance_squared / (area * cos_light);
  return true;
}

// Samples a light as it is seen from a point; false if it does not shine there.
bool sample_light(GpuLight light, vec3 point, vec2 u, out LightSample result) {
  result = LightSample(vec3(0.0), 3.4e38, light.emission, 0.0, gain_of(light));
  switch (light.type) {
    case LIGHT_POINT:
    case LIGHT_SPOT: {
      const vec3 to_light = light.position - point;
      const float distance_squared = dot(to_light, to_light);
      if (distance_squared <= 0.0) return false;
      result.t_max = sqrt(distance_squared) * SHADOW_END;
      result.direction = to_light / sqrt(distance_squared);
      result.radiance *= spot_falloff(light, -dot(result.direction, light.direction)) / distance_squared;
      return true;
    }
    case LIGHT_DIRECTIONAL:
      result.direction = -light.direction;
      if (light.cone_sr > 0.0) {
        result.direction = sample_cone(-light.direction, light.cone_sr / (2.0 * PI), u);
        result.pdf = 1.0 / light.cone_sr;
      }
      return true;
    case LIGHT_SPHERE: {
      const vec3 to_center = light.position - point;
      const float distance_squared = dot(to_center, to_center);
      if (distance_squared <= light.radius * light.radius) return false;  // it emits outwards only
      const float cap = sphere_cap(light.radius, distance_squared);
      result.direction = sample_cone(to_center / sqrt(distance_squared), cap, u);
      const float t = intersect_sphere(point, result.direction, light.position, light.radius);
      // Rounding may let a grazing sample miss; its ray then ends at the point of tangency.
      result.t_max = (t > 0.0 ? t : sqrt(distance_squared - light.radius * light.radius)) * SHADOW_END;
      result.pdf = 1.0 / (2.0 * PI * cap);
      return cap > 0.0;
    }
    case LIGHT_RECTANGLE:
      return sample_area(light, point,
                         light.position + (u.x - 0.5) * light.edge_u + (u.y - 0.5) * light.edge_v,
                         light.direction, length(light.edge_u) * length(light.edge_v), false, result);
    default: {  // LIGHT_TRIANGLE
      const float root = sqrt(u.x);
      const vec2 b = vec2(1.0 - root, u.y * root);
      result.radiance = triangle_emission(light, b);
      return sample_area(light, point, light.position + b.x * light.edge_u + b.y * light.edge_v,
                         light.direction, 0.5 * length(cross(light.edge_u, light.edge_v)), true, result);
    }
  }
}

// Returns the density per steradian with which sample_light() chooses this point of an emissive
// triangle.
float triangle_pdf(GpuLight light, vec3 direction, float t) {
  const float area = 0.5 * length(cross(light.edge_u, light.edge_v));
  return t * t / max(area * abs(dot(direction, light.direction)), 1e-30);
}

// Intersects a ray with a light that is not a mesh. It returns the distance, below 0 for a miss,
// and in `pdf` the density with which sample_light() would have chosen the direction. Directional
// discs are at infinity.
float meet_light(GpuLight light, vec3 origin, vec3 direction, out float pdf) {
  pdf = 0.0;
  if (light.type == LIGHT_DIRECTIONAL) {
    // The chord between the directions is compared with that of the disc's radius r, 2 sin(r / 2),
    // whose solid angle is 4 pi sin^2(r / 2). Cosines would not do: those of small angles are all
    // equal.
    const vec3 chord = direction + light.direction;
    if (light.cone_sr <= 0.0 || dot(chord, chord) > light.cone_sr / PI) return -1.0;
    pdf = 1.0 / light.cone_sr;
    return 3.3e38;
  }
  if (light.type == LIGHT_SPHERE) {
    const float t = intersect_sphere(origin, direction, light.position, light.radius);
    if (t <= 0.0) return -1.0;
    const vec3 to_center = light.position - origin;
    pdf = 1.0 / (2.0 * PI * sphere_cap(light.radius, dot(to_center, to_center)));
    return t;
  }
  const float cos_light = -dot(direction, light.direction);  // LIGHT_RECTANGLE
  if (cos_light <= 0.0) return -1.0;
  const vec3 to_plane = light.position - origin;
  const float t = -dot(to_plane, light.direction) / cos_light;
  if (t <= 0.0) return -1.0;
  const vec3 off = t * direction - to_plane;
  const float a = dot(off, light.edge_u) / dot(light.edge_u, light.edge_u);
  const float b = dot(off, light.edge_v) / dot(light.edge_v, light.edge_v);
  if (!(abs(a) <= 0.5 && abs(b) <= 0.5)) return -1.0;  // NaN where a side rounds to 0
  pdf = t * t / (length(light.edge_u) * length(light.edge_v) * cos_light);
  return t;
}

#endif
