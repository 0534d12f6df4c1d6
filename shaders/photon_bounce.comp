// Continues photons that have arrived at a surface. A photon forks where the worlds part, continues
// by Dirac lobes only, and after at least one of them may stay on a surface with another lobe
// (shaders/README.md, "Caustics").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/append.glsl"
#include "shaders/lib/medium.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/photon.glsl"

struct Flight {
  vec3 origin;
  float t_min;
  vec3 direction;
  float survival;  // what Dirac lobes and media left of the flux so far, for Russian roulette
  vec3 flux;
  uint worlds;
  uint vertices;
  uint medium;
  uint passes;     // panes that it met and passed
  bool is_behind;  // see PATH_BEHIND
};

Flight load_flight(uint path) {
  const vec4 origin = read_ray_origin(path);
  const vec4 direction = read_ray_direction(path);
  const GpuThroughput carried = read_throughput(path);
  const uint bits = carried.state;
  return Flight(origin.xyz, origin.w, direction.xyz, direction.w, carried.factor, path_worlds(bits),
                path_depth(bits), path_medium(bits), path_passes(bits), path_is_behind(bits));
}

void store_flight(Flight f, uint path) {
  ray_origin[path] = vec4(f.origin, f.t_min);
  ray_direction[path] = vec4(f.direction, f.survival);
  const uint bits = f.worlds | (f.is_behind ? PATH_BEHIND : 0u) |
                    (f.passes << PATH_PASSES_SHIFT) | (f.vertices << PATH_DEPTH_SHIFT) |
                    (f.medium << PATH_MEDIUM_SHIFT);
  write_throughput(path, f.flux, bits);
}

// Samples the Dirac lobes of a surface in the direction of light. It is the adjoint of
// bsdf_sample(), which follows paths from the camera: the colour of a solid tints on leaving, and
// flux that enters is divided by ior^2, because bsdf_sample() leaves radiance unscaled.
bool sample_dirac(Surface s, Lobes l, vec3 through, float p_mirror, float choice, out vec3 wi,
                  out vec3 weight) {
  const float p_clear = has_clear_normal() ? p_mirror * clear_mirror_share(l) : 0.0;
  const bool clear = has_clear_normal() && choice < p_clear;
  const vec3 normal = clear ? lacquer_normal(s) : s.normal;
  const float cos_o = dot(normal, s.wo);
  wi = vec3(0.0);
  weight = vec3(0.0);
  if (cos_o <= 0.0) return false;
  if (choice < p_mirror) {
    wi = 2.0 * cos_o * normal - s.wo;
    weight = clear ? vec3(l.clear) / p_clear : mirror_color(l, cos_o) / (p_mirror - p_clear);
    if (!reflects_to(s, wi, normal)) return false;
  } else if (has_feature(FEATURE_PANES) && any(greaterThan(through, vec3(0.0)))) {
    wi = 2.0 * cos_o * s.normal - s.wo;  // what passes the pane has passed
    weight = vec3(l.glass / (1.0 - p_mirror));
    if (!reflects_to(s, wi)) return false;
  } else {
    const float fresh = clamp((choice - p_mirror) / (1.0 - p_mirror), 0.0, 0.99999994);
    if (!sample_glass(s, fresh, wi, weight)) return false;
    if (!s.thin_walled && dot(wi, s.geometric_normal) < 0.0)
      weight = s.entering ? vec3(1.0 / (s.ior * s.ior)) : s.base_color * (s.ior * s.ior);
    if (has_sheen(s)) l = under_sheen(s, l, wi);
    weight *= l.glass / (1.0 - p_mirror);
  }
  // The geometric normal decides how light spreads over a surface, but the interpolated one defines
  // the lobes (Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section
  // 5.3).
  weight *= abs(dot(wi, s.geometric_normal)) * cos_o /
            (dot(s.wo, s.geometric_normal) * abs(dot(wi, normal)));
  return true;
}

// Takes away the light that is lost on the way to the surface.
void cross_medium(inout Flight f, Surface s, float t) {
  if (!has_feature(FEATURE_ATTENUATION)) return;
  f.medium = medium_before(f.medium, s);
  const vec3 left = medium_transmittance(f.medium, t);
  f.flux *= left;
  f.survival *= max(max(left.r, left.g), left.b);
}

const uint FLIGHT_OVER = 0u;
const uint FLIGHT_STAYS = 1u;
const uint FLIGHT_GOES_ON = 2u;

// Lets a photon that has met a pane pass in the colour that is left, for which the result is true, or
// makes up for those that have passed.
bool pass_pane(inout Flight f, vec3 through, GpuHit hit) {
  if (all(lessThanEqual(through, vec3(0.0)))) return false;
  const uint key = hash_meeting(hit.instance, hit.primitive, f.origin, f.direction);
  vec3 factor;
  const bool passes = passes_met_pane(through, unit_float(hash_bits(key ^ KEY_PASSES_MET)), factor);
  f.flux *= factor;
  f.t_min = passes ? hit.t : f.t_min;
  f.is_behind = passes;
  f.passes += uint(passes);
  return passes;
}

// Decides what a photon does at a surface, and divides its flux by the probability of the decision.
uint meet_surface(inout Flight f, Surface s, GpuHit hit, vec2 random) {
  Lobes l = make_lobes(s);
  vec3 through = vec3(0.0);
  if (has_feature(FEATURE_PANES)) {
    through = pane_transmittance(s);
    if (pass_pane(f, through, hit)) {
      if (f.passes <= MOST_PASSES) return FLIGHT_GOES_ON;
      atomicAdd(control.stopped_in_layers, 1u);
      return FLIGHT_OVER;
    }
    l = without_passing(s, l, through);
  }
  cross_medium(f, s, hit.t);
  const float mirror = mirror_probability(l);
  const float dirac = mirror + (l.smooth_glass ? l.p_glass : 0.0);
  const float rough = is_rough(l) ? 1.0 - dirac : 0.0;
  const float p_stay = f.vertices > 0u && rough > 0.0 ? rough / (rough + dirac) : 0.0;
  if (random.x < p_stay) {
    f.flux /= p_stay;
    return FLIGHT_STAYS;
  }
  const float fresh = min((random.x - p_stay) / (1.0 - p_stay), 0.99999994);
  vec3 weight;
  vec3 wi;
  if (dirac <= 0.0 || !sample_dirac(s, l, through, mirror / dirac, fresh, wi, weight))
    return FLIGHT_OVER;
  f.flux *= weight / (1.0 - p_stay);
  f.vertices += 1u;
  f.survival *= min(max(max(weight.r, weight.g), weight.b), 1.0);
  const float survival = f.vertices < frame.roulette_depth ? 1.0 : survival_of(f.survival);
  if (random.y >= survival) return FLIGHT_OVER;
  f.flux /= survival;
  f.survival /= survival;
  f.origin = offset_origin(s, wi);
  f.t_min = 0.0;
  f.is_behind = false;
  f.direction = wi;
  f.medium = medium_beyond(f.medium, s, wi);
  // After the last allowed vertex a photon ends, because one that stayed later would never be
  // gathered.
  return f.vertices < frame.max_depth ? FLIGHT_GOES_ON : FLIGHT_OVER;
}

// Stores a photon, with its flux in the worlds that it is in.
void store_photon(uint path, Flight f, Surface s) {
  photons[path].position = s.position;
  photons[path].vertices = f.vertices;
  photons[path].direction = f.direction;
  photons[path].normal = s.geometric_normal;
  photons[path].mixed *= (f.worlds & WORLD_MIXED) != 0u ? f.flux : vec3(0.0);
  photons[path].real *= (f.worlds & WORLD_REAL) != 0u ? f.flux : vec3(0.0);
  photon_keys[path] = photon_bucket(s.position);
}

void main() {
  uint path = NO_INDEX;
  uint forked = NO_INDEX;
  uint outcome = FLIGHT_OVER;
  if (gl_GlobalInvocationID.x < control.active_count) {
    path = read_queue(active_queue_index(gl_GlobalInvocationID.x));
    const GpuHit hit = read_hit(path);
    if (hit.t >= 0.0) {
      Flight f = load_flight(path);
      const uint presence = instance_at(hit.instance).presence & f.worlds;
      if (presence != f.worlds) {
        Flight other = f;
        other.worlds = f.worlds & ~presence;
        other.t_min = forked_t_min(f.t_min, hit.t, other.is_behind);
        forked = path ^ 1u;
        store_flight(other, forked);
        f.worlds = presence;
      }
      const Surface s = make_surface(hit, f.direction, 0.0);
      outcome = meet_surface(f, s, hit, sample_2d(photon_sampler(path >> 1), PAIR_BOUNCE + f.vertices));
      if (outcome == FLIGHT_STAYS) store_photon(path, f, s);
      if (outcome == FLIGHT_GOES_ON) store_flight(f, path);
    }
  }
  append_next(forked != NO_INDEX, forked);
  append_next(outcome == FLIGHT_GOES_ON, path);
}
