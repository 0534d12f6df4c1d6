// Photons of one pass: from a light, by mirrors and glass only, to the first surface on which they
// stay. A photon may fork where the worlds part, and so leaves up to two behind.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon.glsl"
#include "shaders/lib/photon_emission.glsl"
#include "shaders/lib/trace.glsl"

struct Flight {
  vec3 origin;
  float t_min;
  vec3 direction;
  vec3 flux;
  float survival;  // product of the Dirac lobes' weights so far, for the roulette
  uint worlds;     // 0: over
  uint vertices;
};

// A resumed ray starts just before where its path parted: what is there is not in its world.
const float RESUME_BEFORE = 0.9999;

// The Dirac lobes of a surface as light meets them: the reverse of what bsdf_sample does from the
// camera, so a solid's colour tints on leaving, and flux that enters it is divided by ior^2 as
// radiance is left unscaled there.
bool sample_dirac(Surface s, Lobes l, float p_mirror, float choice, out vec3 wi, out vec3 weight) {
  const float cos_o = dot(s.normal, s.wo);
  wi = vec3(0.0);
  weight = vec3(0.0);
  if (cos_o <= 0.0) return false;
  if (choice < p_mirror) {
    wi = 2.0 * cos_o * s.normal - s.wo;
    weight = reflection_color(l, cos_o) / p_mirror;
    if (!reflects_to(s, wi)) return false;
  } else {
    const float fresh = clamp((choice - p_mirror) / (1.0 - p_mirror), 0.0, 0.99999994);
    if (!sample_glass(s, fresh, wi, weight)) return false;
    if (!s.thin_walled && dot(wi, s.geometric_normal) < 0.0)
      weight = s.entering ? vec3(1.0 / (s.ior * s.ior)) : s.base_color * (s.ior * s.ior);
    weight *= l.glass / (1.0 - p_mirror);
  }
  // Light is spread by the geometric normal, lobes are defined by the interpolated one (Veach 1997,
  // "Robust Monte Carlo methods", 5.3).
  weight *= abs(dot(wi, s.geometric_normal)) * cos_o /
            (dot(s.wo, s.geometric_normal) * abs(dot(wi, s.normal)));
  return true;
}

// Goes on from a vertex by a Dirac lobe, or ends the flight and says that the photon stays here.
bool stays(inout Flight f, Surface s, vec2 random) {
  const Lobes l = make_lobes(s);
  const float mirror = l.smooth_reflection ? l.p_reflection : 0.0;
  const float dirac = mirror + l.p_glass;
  const float rough = l.p_diffuse + l.p_reflection - mirror;
  const float p_stay = f.vertices > 0u && rough > 0.0 ? rough / (rough + dirac) : 0.0;
  if (random.x < p_stay) {
    f.flux /= p_stay;
    return true;
  }
  const float fresh = min((random.x - p_stay) / (1.0 - p_stay), 0.99999994);
  vec3 weight;
  vec3 wi;
  if (dirac <= 0.0 || !sample_dirac(s, l, mirror / dirac, fresh, wi, weight)) {
    f.worlds = 0u;
    return false;
  }
  f.flux *= weight / (1.0 - p_stay);
  f.vertices += 1u;
  f.survival *= min(max(max(weight.r, weight.g), weight.b), 1.0);
  if (f.vertices >= frame.roulette_depth && f.survival < 1.0) {
    if (random.y >= f.survival) f.worlds = 0u;
    f.flux /= f.survival;
    f.survival = 1.0;
  }
  f.origin = offset_origin(s, wi);
  f.t_min = 0.0;
  f.direction = wi;
  return false;
}

// Follows a flight to its end; `forked` is what the other world goes on with, where they part.
GpuPhoton follow(Flight f, Sampler random, vec2 gain, inout Flight forked) {
  GpuPhoton none = GpuPhoton(vec3(0.0), 0u, vec3(0.0), vec3(0.0), vec3(0.0), vec2(0.0));
  while (f.worlds != 0u && f.vertices < frame.max_depth) {
    Hit hit;
    if (!trace_closest(f.origin, f.direction, f.t_min * RESUME_BEFORE, 3.4e38, f.worlds, hit)) break;
    const uint presence = instances[hit.instance].presence & f.worlds;
    if (presence != f.worlds) {
      forked = f;
      forked.worlds = f.worlds & ~presence;
      forked.t_min = hit.t;
      f.worlds = presence;
    }
    const Surface s =
        make_surface(GpuHit(hit.t, hit.barycentrics, hit.instance, hit.primitive), f.direction);
    const vec3 direction = f.direction;
    if (!stays(f, s, sample_2d(random, PAIR_BOUNCE + f.vertices))) continue;
    const vec2 seen = gain * vec2((f.worlds & WORLD_MIXED) != 0u, (f.worlds & WORLD_REAL) != 0u);
    return GpuPhoton(s.position, f.vertices, direction, s.geometric_normal, f.flux, seen);
  }
  return none;
}

void store_photon(uint index, GpuPhoton photon) {
  const bool valid = photon_stored(photon) && any(greaterThan(photon.flux, vec3(0.0)));
  if (!valid) photon.gain = vec2(0.0);
  photons[index] = photon;
  if (valid) atomicAdd(buckets[photon_bucket(photon_cell(photon.position))].count, 1u);
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= frame.photon_count) return;
  // All photons of many passes are one sequence.
  const uint passes = 4096u;
  const Sampler random = make_sampler(frame.seed, uvec2(NO_INDEX, batch.first_sample / passes),
                                      (batch.first_sample % passes) * frame.photon_count + index);
  const Emission e = emit_photon(random);
  Flight flight = Flight(e.origin, 0.0, e.direction, e.flux, 1.0, 0u, 0u);
  flight.worlds = (e.gain.x > 0.0 ? WORLD_MIXED : 0u) | (e.gain.y > 0.0 ? WORLD_REAL : 0u);
  if (!any(greaterThan(e.flux, vec3(0.0)))) flight.worlds = 0u;
  Flight forked = flight;
  forked.worlds = 0u;
  Flight unused = forked;
  store_photon(2u * index, follow(flight, random, e.gain, forked));
  store_photon(2u * index + 1u, follow(forked, random, e.gain, unused));
}
