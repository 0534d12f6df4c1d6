// Continues paths that have arrived at a surface or in the environment. A path forks where the
// worlds part, takes emission, samples a light and scatters (shaders/README.md). A CPU device does all
// of it in one pass. On a card three share it, one after the other: together they work out the surface
// three times, but each needs so few registers that more lanes are under way (tests/bench/RESULTS.md).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/append.glsl"
#include "shaders/lib/camera.glsl"
#include "shaders/lib/difference_bounds.glsl"
#include "shaders/lib/environment.glsl"
#include "shaders/lib/gather.glsl"
#include "shaders/lib/medium.glsl"
#include "shaders/lib/pane.glsl"

layout(constant_id = 2) const uint PARTS = SHADE_ALL;
bool does(uint part) { return (PARTS & part) != 0u; }

struct Path {
  uint index;
  uint slot;
  vec3 origin;
  float t_min;
  vec3 direction;
  float pdf;  // density of the direction; 0 if a light sample could not find it
  vec3 throughput;
  uint worlds;
  uint depth;
  bool rough;  // some vertex so far scattered by a lobe that is not Dirac
  bool difference;  // light that is equal in both worlds need not be traced
  bool landed;      // see PATH_LANDED
  uint medium;      // see lib/medium.glsl
  uint receiver;    // the packed normal of its last vertex (lib/light_tree.glsl)
  uint passes;      // panes that it met and passed
  bool is_behind;   // see PATH_BEHIND
};

Path load_path(uint index) {
  const vec4 origin = read_ray_origin(index);
  const vec4 direction = read_ray_direction(index);
  const GpuThroughput throughput = read_throughput(index);
  const uint bits = throughput.state;
  return Path(index, path_slot(index), origin.xyz, origin.w, direction.xyz, direction.w, throughput.factor,
              path_worlds(bits), path_depth(bits), (bits & PATH_ROUGH) != 0u,
              (has_feature(FEATURE_DIFFERENCE) || has_feature(FEATURE_CAMERA)) &&
                  (bits & PATH_DIFFERENCE) != 0u,
              has_feature(FEATURE_CAMERA) && (bits & PATH_LANDED) != 0u, path_medium(bits),
              has_feature(FEATURE_MANY_LIGHTS) ? read_path_receiver(index) : NO_NORMAL,
              path_passes(bits), path_is_behind(bits));
}

void store_path(Path p, uint index) {
  ray_origin[index] = vec4(p.origin, p.t_min);
  ray_direction[index] = vec4(p.direction, p.pdf);
  const uint bits = p.worlds | (p.rough ? PATH_ROUGH : 0u) |
                    (p.difference ? PATH_DIFFERENCE : 0u) | (p.landed ? PATH_LANDED : 0u) |
                    (p.is_behind ? PATH_BEHIND : 0u) | (p.passes << PATH_PASSES_SHIFT) |
                    (p.depth << PATH_DEPTH_SHIFT) | (p.medium << PATH_MEDIUM_SHIFT);
  write_throughput(index, p.throughput, bits);
  if (has_feature(FEATURE_MANY_LIGHTS)) path_receiver[index] = p.receiver;
}

// Returns whether light at the end of this path is a caustic: a lobe that is not Dirac has
// scattered the path, and then a Dirac lobe.
bool is_caustic(Path p) { return p.rough && p.pdf <= 0.0; }

// Returns whether light with this gain is equal in both worlds of the path and so cancels.
bool cancels(Path p, Gain gain) {
  return p.difference && p.worlds == WORLD_BOTH && gain.mixed == gain.real;
}

void receive(Path p, vec3 radiance, Gain gain) {
  if (!does(SHADE_RECEIVE)) return;
  add_pair(p.slot, p.worlds, p.landed, radiance * gain.mixed, radiance * gain.real);
}

// Returns the weight of the power heuristic with exponent 2 (Veach 1997, section 9.2). pdf = 0
// stands for a direction that a light sample cannot find, whose weight is 1.
float mis_weight(float pdf, float other) {
  if (pdf <= 0.0) return 1.0;
  const float ratio = other / pdf;
  return 1.0 / (1.0 + ratio * ratio);
}

// Returns the probability with which a light sample at the path's last vertex would have picked this
// light; 0 if it had none.
float selection_of(Path p, GpuLight light) {
  if (p.pdf <= 0.0) return 0.0;
  return (1.0 - frame.environment_selection) *
         light_selection(light, make_receiver(p.origin, p.receiver));
}

// Adds a light without a mesh if the ray crosses it before its hit.
void cross_light(Path p, uint index, float t_hit) {
  const GpuLight light = light_at(index);
  const Gain gain = gain_of(light);
  if (cancels(p, gain)) return;
  float pdf;
  const float t = meet_light(light, p.origin, p.direction, pdf);
  if (t < 0.0 || t <= p.t_min || t > t_hit) return;
  const float other = selection_of(p, light) * pdf;
  receive(p, p.throughput * light.emission * mis_weight(p.pdf, other) *
                 medium_transmittance(p.medium, t), gain);
}

// Adds the lights without a mesh that the ray crosses before its hit. They block nothing.
void meet_lights(Path p, float t_hit) {
  const bool by_tree = has_tree() && frame.visible_light_count > FEW_LIGHTS;
  const uint tried = by_tree ? frame.distant_light_count : frame.visible_light_count;
  for (uint i = 0u; i < tried; ++i) cross_light(p, i, t_hit);
  const uint wanted = cancels(p, EQUAL_GAIN) ? LIGHT_NODE_DIFFERS : LIGHT_NODE_VISIBLE;
  uint node = by_tree ? 0u : NO_INDEX;
  while (has_feature(FEATURE_MANY_LIGHTS) && node != NO_INDEX) {
    const uint index = next_crossed(wanted, node, p.origin + frame.tree_offset, p.direction, t_hit);
    if (index != NO_INDEX) cross_light(p, index, t_hit);
  }
}

void meet_environment(Path p) {
  if (cancels(p, EQUAL_GAIN)) return;
  float weight = 1.0;
  float pdf;
  const vec3 radiance = environment_radiance(p.direction, pdf);
  if (has_feature(FEATURE_ENVIRONMENT_SAMPLING) && p.pdf > 0.0)
    weight = mis_weight(p.pdf, frame.environment_selection * pdf);
  receive(p, p.throughput * radiance * weight *
                 medium_transmittance(p.medium, 3.4e38), EQUAL_GAIN);
}

void meet_emission(Path p, Surface s, GpuHit hit) {
  if (all(equal(s.emission, vec3(0.0))) || cancels(p, EQUAL_GAIN)) return;
  float weight = 1.0;
  const uint first = instance_at(hit.instance).first_light;
  if (has_feature(FEATURE_LIGHTS) && p.pdf > 0.0 && first != NO_INDEX) {
    const GpuLight light = placeless_light(first + hit.primitive);
    const float pdf = triangle_pdf(light, p.direction, hit.t);
    weight = mis_weight(p.pdf, selection_of(p, light) * pdf);
  }
  receive(p, p.throughput * s.emission * weight, EQUAL_GAIN);
}

// If less than this part of bound_share would suffice, the objects are left to the BSDF, which
// saves evaluating the bounds.
const float least_bound_part = 0.04;

// A technique says how directions are sampled at a vertex: a share of them is aimed at the objects
// that are in one world only, the others follow the BSDF. It depends on shared data alone, so it is
// equal in both worlds.
struct Technique {
  float share;  // of directions that are aimed, 0 to 1
  float total;  // bounds_total() of the vertex
};

// Returns the part of bound_share that is worth spending (shaders/README.md, "Difference bounds"):
// (1 - l) max(0, 1 - T/E) + l max(0, 1 - T/L), with T the solid angle of the objects, E and L those
// from which the light of the environment and of the lamps comes, and l the lamps' part of all
// power. Light samples by themselves find a difference whose light comes from a narrower solid
// angle than T, such as the shadow of a large object under a small lamp.
float part_for_bounds(float total) {
  const float environment = max(1.0 - total / frame.environment_spread, 0.0);
  const float lamps = max(1.0 - total / frame.lamp_spread, 0.0);
  return mix(environment, lamps, frame.lamp_part);
}

Technique make_technique(Path p, Surface s, Lobes l) {
  if (!has_feature(FEATURE_FORKS) || p.worlds != WORLD_BOTH || !is_rough(l)) return Technique(0.0, 0.0);
  const float total = bounds_total(s.position);
  const float part = total > 0.0 ? part_for_bounds(total) : 0.0;
  return Technique(part >= least_bound_part ? part * frame.bound_share : 0.0, total);
}

// Returns the density of a direction over both techniques, given that of the BSDF alone.
float combined_pdf(Technique t, Surface s, vec3 direction, float bsdf_pdf) {
  if (t.share <= 0.0) return bsdf_pdf;
  return mix(bsdf_pdf, bounds_pdf(s.position, t.total, direction), t.share);
}

bool sample_lobes(Surface s, inout Lobes l, vec2 u, float choice, out vec3 direction, out vec3 weight,
                  out bool is_dirac, out float others) {
  others = 1.0;
  if (has_feature(FEATURE_PANES) && any(greaterThan(pane_transmittance(s), vec3(0.0))))
    return sample_met_pane(s, l, u, choice, direction, weight, is_dirac, others);
  return bsdf_sample(s, l, u, choice, direction, weight, is_dirac);
}

// Samples a direction by either technique. `weight` is its throughput, and `pdf` the density per
// steradian over both, 0 for a Dirac lobe. The result is false where the light is absorbed.
bool sample_direction(Technique t, Surface s, Lobes l, vec2 u, float choice, out vec3 direction,
                      out vec3 weight, out float pdf) {
  const bool aimed = choose(u.x, t.share);
  bool is_dirac = false;
  float others = 1.0;
  pdf = 0.0;
  if (aimed) direction = bounds_sample(s.position, t.total, u);
  else if (!sample_lobes(s, l, u, choice, direction, weight, is_dirac, others)) return false;
  if (is_dirac) {
    if (t.share > 0.0) weight *= 1.0 / (1.0 - t.share);
    return true;
  }
  float bsdf_pdf;
  const vec3 value = bsdf_evaluate(s, l, direction, bsdf_pdf);
  if (bsdf_pdf <= 0.0) return false;
  const float own_pdf = bsdf_pdf * others;
  pdf = combined_pdf(t, s, direction, own_pdf);
  if (aimed) {
    weight = value / pdf;
  } else {
    weight = value / bsdf_pdf / others;
    if (t.share > 0.0) weight *= own_pdf / pdf;
  }
  return true;
}

// Picks the environment, for which the result is ENVIRONMENT, or a light that may shine on the vertex,
// with the probability `selection`; u.x is stretched. NO_INDEX: there is none.
const uint ENVIRONMENT = 0xfffffffeu;

uint choose_light(Path p, Surface s, Sampler random, inout float u, out float selection) {
  selection = frame.environment_selection;
  if (has_feature(FEATURE_LIGHTS) && !choose(u, selection)) {
    if (frame.light_count == 0u) return NO_INDEX;
    uint index;
    float among_lights;
    if (has_tree()) {
      const vec2 lamp = sample_2d(random, PAIR_LAMP + p.depth);
      index = select_light(make_receiver(s.position, p.receiver), lamp, among_lights);
    } else {
      index = pick_light(u, false);
      among_lights = placeless_light(index).selection;
    }
    selection = (1.0 - selection) * among_lights;
    return index;
  }
  return has_feature(FEATURE_ENVIRONMENT_SAMPLING) ? ENVIRONMENT : NO_INDEX;
}

// Samples what was chosen as seen from a point; false if it does not shine there.
bool sample_chosen(uint chosen, vec3 point, vec2 u, out LightSample light) {
  light = LightSample(vec3(0.0), 3.4e38, vec3(0.0), 0.0, EQUAL_GAIN);
  if (chosen == NO_INDEX) return false;
  if (has_feature(FEATURE_LIGHTS) && chosen != ENVIRONMENT)
    return sample_light(light_at(chosen), point, u, light);
  light.direction = environment_sample(u, light.pdf);
  light.radiance = environment_radiance(light.direction);
  return true;
}

// Makes the shadow ray of one light sample, which carries the pair of radiances that the sample
// brings to the worlds if nothing blocks it. Returns false if there is nothing to trace.
bool light_ray(Path p, Surface s, Lobes l, Technique t, Sampler random, out GpuShadowRay ray) {
  vec2 u = sample_2d(random, vertex_pair(PAIR_LIGHT, p.depth));
  LightSample light;
  float selection;
  const uint chosen = choose_light(p, s, random, u.x, selection);
  // The light is sampled from the very point at which the shadow ray starts; otherwise the ray
  // could end behind the light. Only rough glass also receives light on the side away from the
  // viewer.
  ray.origin = offset_origin(s, s.geometric_normal);
  if (!sample_chosen(chosen, ray.origin, u, light)) return false;
  if (has_feature(FEATURE_TRANSMISSION) && has_rough_glass(l) &&
      dot(light.direction, s.geometric_normal) < 0.0) {
    ray.origin = offset_origin(s, -s.geometric_normal);
    if (!sample_chosen(chosen, ray.origin, u, light)) return false;
  }
  float bsdf_pdf;
  const vec3 value = bsdf_evaluate(s, l, light.direction, bsdf_pdf);
  const bool delta = light.pdf <= 0.0;
  const float pdf = selection * (delta ? 1.0 : light.pdf);
  if (pdf <= 0.0) return false;
  const float weight =
      delta ? 1.0 : mis_weight(pdf, combined_pdf(t, s, light.direction, bsdf_pdf));
  ray.direction = light.direction;
  ray.t_max = light.t_max;
  ray.path_and_worlds = (p.index << 3) | (p.landed ? 4u : 0u) | p.worlds;
  vec3 contribution = p.throughput * value * light.radiance * (weight / pdf);
  if (has_feature(FEATURE_ATTENUATION))
    contribution *= medium_transmittance(medium_beyond(p.medium, s, light.direction),
                                         light.t_max / SHADOW_END);
  ray.mixed = (p.worlds & WORLD_MIXED) != 0u ? contribution * light.gain.mixed : vec3(0.0);
  ray.real = (p.worlds & WORLD_REAL) != 0u ? contribution * light.gain.real : vec3(0.0);
  if (cancels(p, light.gain) && !meets_bounds(ray.origin, ray.direction, ray.t_max)) return false;
  // NaN is kept, to be counted.
  return any(notEqual(ray.mixed, vec3(0.0))) || any(notEqual(ray.real, vec3(0.0)));
}

// Adds caustics by photons. Both worlds sum the same photons in the same order, so that the sums
// are equal wherever the photons are.
void meet_photons(Path p, Surface s, Lobes l) {
  if (!is_rough(l)) return;
  const bool differing = cancels(p, EQUAL_GAIN);
  const GatheredPair gathered = gather_photons(s, l, frame.max_depth - p.depth - 1u, differing);
  const vec3 mixed = p.throughput * gathered.mixed;
  const vec3 real = p.throughput * gathered.real;
  add_pair(p.slot, p.worlds, p.landed, mixed, real);
  if (p.rough) return;
  const float weight = mean_square(p.throughput);
  if ((p.worlds & WORLD_MIXED) != 0u)
    sample_caustic[2u * p.slot] += vec4(mixed, min(weight * gathered.mixed_variance, MOST_VARIANCE));
  if ((p.worlds & WORLD_REAL) != 0u)
    sample_caustic[2u * p.slot + 1u] += vec4(real, min(weight * gathered.real_variance, MOST_VARIANCE));
}

// Samples the next direction and prepares the path for it. Returns false if the path ends.
bool scatter(inout Path p, Surface s, Lobes l, Technique t, Sampler random, vec2 chance) {
  vec3 direction;
  vec3 weight;
  float pdf;
  const vec2 u = sample_2d(random, vertex_pair(PAIR_SCATTER, p.depth));
  if (!sample_direction(t, s, l, u, chance.y, direction, weight, pdf)) return false;
  p.throughput *= weight;
  if (all(equal(p.throughput, vec3(0.0)))) return false;
  const float survival = p.depth + 1u < frame.roulette_depth ? 1.0 : survival_of(largest_of(abs(p.throughput)));
  if (chance.x >= survival) return false;
  p.throughput /= survival;
  p.origin = offset_origin(s, direction);
  p.t_min = 0.0;
  p.is_behind = false;
  p.direction = direction;
  p.medium = medium_beyond(p.medium, s, direction);
  p.pdf = pdf;
  p.rough = p.rough || pdf > 0.0;
  return true;
}

// Lets a path that has met a pane pass in the colour that is left, for which the result is true, or
// makes up for those that have passed.
bool pass_pane(inout Path p, Surface s, GpuHit hit) {
  const vec3 through = pane_transmittance(s);
  if (all(lessThanEqual(through, vec3(0.0)))) return false;
  const uint key = hash_meeting(hit.instance, hit.primitive, p.origin, p.direction);
  vec3 factor;
  const bool passes = passes_met_pane(through, unit_float(hash_bits(key ^ KEY_PASSES_MET)), factor);
  p.throughput *= factor;
  p.t_min = passes ? hit.t : p.t_min;
  p.is_behind = passes;
  p.passes += uint(passes);
  return passes;
}

// Forks the path: in the worlds that do not contain the hit it continues along the same ray, as a
// path of its own.
void fork(Path p, uint other_worlds, float t_hit, out uint forked) {
  forked = p.landed ? 2u * slot_count() + p.slot : p.index ^ 1u;
  p.worlds = other_worlds;
  p.t_min = forked_t_min(p.t_min, t_hit, p.is_behind);
  store_path(p, forked);
}

// These count in 64 bits.
void count_measured() {
  if (!does(SHADE_RECEIVE)) return;
  if (atomicAdd(control.measured_low, 1u) == 0xffffffffu) atomicAdd(control.measured_high, 1u);
}
void count_unmeasured() {
  if (!does(SHADE_RECEIVE)) return;
  if (atomicAdd(control.unmeasured_low, 1u) == 0xffffffffu) atomicAdd(control.unmeasured_high, 1u);
}

// Returns whether a surface looks the same from everywhere, but for the coat of paint or plastic: such
// a coat is left out of account where it is rough and reflects little, to the viewer and to the
// camera (shaders/README.md, "Camera radiance").
const float LEAST_MATT_ALPHA = 0.25;
const float MOST_COAT = 0.1;

bool is_matt(Surface s) {
  if (has_sheen(s)) return false;
  if (!is_specular(s)) return true;
  if (s.metallic > 0.0 || s.transmission > 0.0 || s.alpha < LEAST_MATT_ALPHA) return false;
  if (has_feature(FEATURE_CLEARCOAT) && s.clearcoat > 0.0) return false;  // lacquer
  const vec3 to_camera = -normalize(s.position);  // the camera is the origin
  const float least_cosine = min(dot(s.normal, s.wo), dot(s.normal, to_camera));
  vec3 color;
  return least_cosine > 0.0 && coat_reflectance(s, least_cosine, color) <= MOST_COAT;
}

// Uses the camera's measurement at a diffuse real surface that the plate shows (shaders/README.md,
// "Camera radiance"). A path of the real world takes it and ends, for which the result is true. A
// path that is in the mixed world takes it as well and continues, once, for the difference of the
// worlds at that point.
bool meet_measured(inout Path p, Surface s, GpuHit hit) {
  const bool is_needed = p.worlds == WORLD_REAL || !(p.landed || cancels(p, EQUAL_GAIN));
  if (p.depth == 0u || !is_needed || (instance_at(hit.instance).presence & WORLD_REAL) == 0u)
    return false;
  vec3 radiance;
  if (!is_matt(s) || any(greaterThan(s.emission, vec3(0.0))) ||
      !measured_radiance(s.position, radiance)) {
    count_unmeasured();
    return false;
  }
  count_measured();
  receive(p, p.throughput * radiance, EQUAL_GAIN);
  if (p.worlds == WORLD_REAL) return true;
  p.worlds = WORLD_BOTH;
  p.difference = true;
  p.landed = true;
  return false;
}

// Paint and plastic reflect about this share of the light around at their surface, beside their
// colour.
const float MEAN_REFLECTANCE = 0.1;

// Returns how bright a surface is: what of white light around it comes back, and what it emits over
// the sensor's white.
vec3 brightness_of(Surface s) {
  const vec3 reflected = s.base_color + s.specular * (1.0 - s.metallic) * MEAN_REFLECTANCE;
  return min(reflected + frame.exposure * s.emission, DENOISE_MOST_WHITES);
}

// Returns how far along the camera's axis a point of the path lies.
float depth_of(Path p, float t) {
  const vec3 axis = vec3(frame.world_from_camera[0].z, frame.world_from_camera[1].z,
                         frame.world_from_camera[2].z);
  return dot(p.origin + t * p.direction, axis);
}

// Returns the area, across the path, over which a sample looks up textures at a distance along it: its
// share of the pixel or of the lobe (shaders/README.md, "Textures"). It is 0 behind a mirror.
float footprint_of(Path p, float t) {
  if (!has_feature(FEATURE_FILTERED_TEXTURES)) return 0.0;
  const float side = 1.0 / float(slot_sample(p.slot) + 1u);
  const float share = side * side;
  if (p.depth == 0u) {
    const float depth = depth_of(p, t);
    return share * depth * depth / (frame.focal_px.x * frame.focal_px.y);
  }
  return p.pdf > 0.0 ? share * t * t / p.pdf : 0.0;
}

// Stores normal, depth and albedo of the mixed world's first surface.
void write_aov(Path p, Surface s, float t) {
  sample_aov[p.slot] = vec4(s.normal, depth_of(p, t));
  if (!has_feature(FEATURE_TEXTURES | FEATURE_VERTEX_COLORS) || frame.keeps_albedo == 0u) return;
  sample_albedo[p.slot] = pack_halves(brightness_of(s));
}

// Adds the light of photons at a vertex, samples a light and the next direction. With `lit`, `ray`
// is a shadow ray to trace; with `scattered`, the path is ready for its next segment.
void shade_vertex(inout Path p, Surface s, out GpuShadowRay ray, out bool lit, out bool scattered) {
  lit = false;
  scattered = false;
  const uvec2 pixel = uvec2(batch.x, batch.y) + slot_pixel(p.slot);
  const Sampler random = slot_sampler(p.slot, pixel);
  const vec2 chance = sample_2d(random, vertex_pair(PAIR_CHANCE, p.depth));
  Lobes l = make_lobes(s);
  if (has_feature(FEATURE_PANES)) l = without_passing(s, l, pane_transmittance(s));
  if (has_feature(FEATURE_MANY_LIGHTS))
    p.receiver = has_feature(FEATURE_TRANSMISSION) && has_rough_glass(l) ? NO_NORMAL
                                                                         : pack_normal(s.normal);
  if (does(SHADE_RECEIVE) && has_feature(FEATURE_PHOTONS)) meet_photons(p, s, l);
  const Technique t = make_technique(p, s, l);
  if (does(SHADE_LIGHT)) lit = light_ray(p, s, l, t, random, ray);
  if (does(SHADE_SCATTER)) scattered = scatter(p, s, l, t, random, chance);
  p.depth += 1u;
}

// Takes the light that a ray brings which meets no surface, or lamps before it.
void receive_on_the_way(Path p, GpuHit hit) {
  if (!does(SHADE_RECEIVE) || !(has_feature(FEATURE_CAUSTICS) || !is_caustic(p))) return;
  const bool has_hit = hit.t >= 0.0;
  if (has_feature(FEATURE_VISIBLE_LIGHTS)) meet_lights(p, has_hit ? hit.t : 3.4e38);
  if (!has_hit) meet_environment(p);
}

// Follows a path to the surface that it met: `forked` is the path that goes on behind it, if there is
// one; the others are those of shade_vertex().
void meet_surface(inout Path p, GpuHit hit, out uint forked, out GpuShadowRay ray, out bool lit,
                  out bool scattered) {
  forked = NO_INDEX;
  lit = false;
  scattered = false;
  const uint presence = instance_at(hit.instance).presence & p.worlds;
  if (has_feature(FEATURE_FORKS) && presence != p.worlds) {
    if (does(SHADE_RECEIVE) && p.depth == 0u) sample_mixed[p.slot].w = 1.0;
    if (does(SHADE_SCATTER)) fork(p, p.worlds & ~presence, hit.t, forked);
    p.worlds = presence;
  }
  const Surface s = make_surface(hit, p.direction, footprint_of(p, hit.t));
  if (does(SHADE_RECEIVE) && p.depth == 0u && (p.worlds & WORLD_MIXED) != 0u) write_aov(p, s, hit.t);
  if (has_feature(FEATURE_PANES) && pass_pane(p, s, hit)) {
    scattered = p.passes <= MOST_PASSES;
    if (does(SHADE_SCATTER) && !scattered) atomicAdd(control.stopped_in_layers, 1u);
    return;
  }
  p.medium = medium_before(p.medium, s);
  p.throughput *= medium_transmittance(p.medium, hit.t);
  if (does(SHADE_RECEIVE) && (has_feature(FEATURE_CAUSTICS) || !is_caustic(p))) meet_emission(p, s, hit);
  if (has_feature(FEATURE_CAMERA) && meet_measured(p, s, hit)) return;
  if (p.depth < frame.max_depth) shade_vertex(p, s, ray, lit, scattered);
}

void main() {
  const bool active_path = gl_GlobalInvocationID.x < control.active_count;
  uint forked = NO_INDEX;
  bool scattered = false;
  bool lit = false;
  GpuShadowRay ray;
  Path p;
  if (active_path) {
    p = load_path(read_queue(active_queue_index(gl_GlobalInvocationID.x)));
    const GpuHit hit = read_hit(p.index);
    receive_on_the_way(p, hit);
    if (hit.t >= 0.0) meet_surface(p, hit, forked, ray, lit, scattered);
    if (does(SHADE_SCATTER) && scattered) store_path(p, p.index);
  }
  if (does(SHADE_LIGHT)) append_shadow(lit, ray);
  if (!does(SHADE_SCATTER)) return;
  append_next(forked != NO_INDEX, forked);
  append_next(scattered, p.index);
}
