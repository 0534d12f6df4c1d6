// Carries what the frames before showed at each pixel along to this frame, and adds this frame to it:
// the mean of the change, which is the difference of the worlds on real surfaces and the radiance of
// virtual ones (shaders/README.md, "Accumulation over time").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_samplerless_texture_functions : require

#include "shaders/lib/halves.glsl"
#include "shaders/lib/history.glsl"
#include "shaders/lib/lens.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;
layout(scalar, push_constant) uniform Show { GpuShow show; };

// This frame's, of the band, as composite.comp makes them.
layout(scalar) readonly buffer Composites { vec4 composites[]; };
layout(scalar) readonly buffer Signals { vec4 signals[]; };
layout(scalar) readonly buffer Variances { vec4 variances[]; };
layout(scalar) readonly buffer Uncovered { vec4 uncovered[]; };
layout(scalar) readonly buffer Albedos { uvec2 albedos[]; };
// This frame's, of the picture, as history_surface.comp makes them.
layout(scalar) readonly buffer Places { vec4 places[]; };
layout(scalar) readonly buffer Things { uvec2 things[]; };
// The history up to the frame before, of its picture.
uniform textureBuffer past_places;
uniform utextureBuffer past_things;
uniform textureBuffer past_lights;
uniform textureBuffer past_squares;
uniform textureBuffer past_uncovered;
uniform utextureBuffer past_albedos;
// The history up to this frame.
layout(scalar) writeonly buffer KeptLights { vec4 kept_lights[]; };    // mean of the change over
                                                                       // white and albedo; 1 / samples
layout(scalar) writeonly buffer KeptSquares { vec4 kept_squares[]; };  // mean square of a sample; mean(M)
layout(scalar) writeonly buffer KeptUncovered { vec4 kept_uncovered[]; };  // of the change; 1: an edge
layout(scalar) writeonly buffer KeptAlbedos { uvec2 kept_albedos[]; };

// A point of the history shows the same surface as a pixel if it lies within this share of the
// distance from the pixel's plane, and the cosine of the normals is at least LEAST_ALIKE.
const float MOST_OFF_PLANE = 0.01;
const float LEAST_ALIKE = 0.9;
// Interpolating between pixels that are f apart blurs by a variance of f (1 - f), in pixels squared.
// Where a history cannot be sharpened again, it is kept for as long as it is blurred by no more than
// this.
const float MOST_BLUR = 2.0;
// The history of an edge shows two surfaces, which move apart.
const float MOST_EDGE_BLUR = 1.0;
// Nearer to a pixel than this, the pixel itself is taken.
const float SNAP = 0.01;
// A camera that moves the picture by less leaves an edge where it was.
const float STILL = 0.25;
// A history that counts as less than this share of a sample is none.
const float LEAST_COUNTED = 0.25;
// An edge becomes a whole pixel again where less than this share of it is left.
const float LEAST_SHARE = 1.0 / 512.0;

struct Kept {
  vec3 light;
  float doubt;  // sum of the squared weights of the samples, 1 / their effective number
  vec3 square;
  float mask;
  vec3 uncovered;
  vec3 albedo;
};

// What a pixel looks for in the frame before.
struct Wanted {
  vec2 at;        // place in its picture; pixel centres are at whole numbers
  vec3 position;  // from its camera
  vec3 normal;
  uint instance, other;
  float mask;
  bool is_edge;
  vec3 albedo;
};

int width() { return int(history.width); }
bool is_inside(ivec2 at, uint w, uint h) {
  return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, ivec2(w, h)));
}
uint in_picture(ivec2 at) { return uint(at.y * width() + at.x); }
float mask_at(ivec2 at) { return composites[in_picture(at) - show.in_picture].w; }

bool is_partly(float mask) { return mask > 0.0 && mask < 1.0; }

// Returns whether what covers the pixel ends in it or beside it.
bool is_edge_now(ivec2 at, float mask) {
  if (is_partly(mask)) return true;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
      const ivec2 there = at + ivec2(x, y);
      if (is_inside(there, history.width, history.height) && mask_at(there) != mask) return true;
    }
  return false;
}

// Returns the pixel of the nearest surface around, which an edge is the outline of.
ivec2 nearest_around(ivec2 at) {
  ivec2 nearest = at;
  float least = 3.4e38;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
      const ivec2 there = at + ivec2(x, y);
      if (!is_inside(there, history.width, history.height)) continue;
      if (things[in_picture(there)].x == NO_INDEX) continue;
      const vec3 place = places[in_picture(there)].xyz;
      if (dot(place, place) >= least) continue;
      least = dot(place, place);
      nearest = there;
    }
  return nearest;
}

// Returns the place of a ray in the picture before.
vec2 project_before(vec2 ray) {
  const vec2 bent = distorted(ray, history.radial, history.radial_divisor, history.tangential);
  return history.focal_px * bent + history.principal_px;
}

// Finds where a pixel was in the frame before, if it moves as the surface at `source` does.
bool find_before(ivec2 at, ivec2 source, out Wanted wanted) {
  const uvec2 thing = things[in_picture(source)];
  if (thing.x == NO_INDEX || motions[thing.x].is_known == 0u) return false;
  const GpuMotion motion = motions[thing.x];
  wanted.position = moved(motion.before_from_now, places[in_picture(source)].xyz);
  const vec3 camera = rotated(history.camera_from_world, wanted.position);
  if (camera.z <= 0.0) return false;
  const vec2 scale = vec2(history.width_before, history.height_before) /
                     vec2(history.width, history.height);
  wanted.at = project_before(camera.xy / camera.z) + scale * vec2(at - source);
  wanted.normal = normalize(rotated(motion.before_from_now, unpack_unit(thing.y)));
  wanted.instance = thing.x;
  wanted.other = things[in_picture(at)].x;
  return all(lessThan(abs(wanted.at), vec2(1e6)));
}

// Returns whether the pixel at the nearest place in the frame before was an edge.
bool was_edge(vec2 at) {
  const ivec2 nearest = ivec2(floor(at + 0.5));
  if (!is_inside(nearest, history.width_before, history.height_before)) return false;
  const int index = nearest.y * int(history.width_before) + nearest.x;
  return is_partly(texelFetch(past_squares, index).w);
}

bool is_same_surface(int index, uint normal, Wanted wanted) {
  const vec3 off = texelFetch(past_places, index).xyz - wanted.position;
  return abs(dot(off, wanted.normal)) <= MOST_OFF_PLANE * length(wanted.position) &&
         dot(unpack_unit(normal), wanted.normal) >= LEAST_ALIKE;
}

// Reads a pixel of the frame before, if it shows what is wanted. An edge, of two surfaces, is kept as
// light, and any other pixel without its albedo.
bool load_past(ivec2 at, Wanted wanted, out Kept kept) {
  if (!is_inside(at, history.width_before, history.height_before)) return false;
  const int index = at.y * int(history.width_before) + at.x;
  const uvec2 thing = texelFetch(past_things, index).xy;
  if (thing.x != wanted.instance && !(wanted.is_edge && thing.x == wanted.other)) return false;
  const vec4 light = texelFetch(past_lights, index);
  if (!(light.w > 0.0)) return false;
  const vec4 square = texelFetch(past_squares, index);
  const vec4 uncovered_part = texelFetch(past_uncovered, index);
  const bool is_kept_as_light = uncovered_part.w > 0.0;
  const vec3 albedo = unpack_halves(texelFetch(past_albedos, index).xy);
  vec3 factor = vec3(history.white_ratio);
  if (wanted.is_edge) {
    factor *= albedo;
    kept.albedo = vec3(1.0);
  } else {
    if (square.w != wanted.mask || !is_same_surface(index, thing.y, wanted)) return false;
    factor /= is_kept_as_light ? wanted.albedo : vec3(1.0);
    kept.albedo = is_kept_as_light ? wanted.albedo : albedo;
  }
  kept.light = light.rgb * factor;
  kept.doubt = light.w;
  kept.square = square.rgb * factor * factor;
  kept.mask = square.w;
  kept.uncovered = uncovered_part.rgb * factor;
  return true;
}

// Returns the weights of four neighbours for a point f behind the second (Catmull and Rom 1974).
vec4 sharp_weights(float f) {
  return vec4(f * (-0.5 + f * (1.0 - 0.5 * f)), 1.0 + f * f * (-2.5 + 1.5 * f),
              f * (0.5 + f * (2.0 - 1.5 * f)), f * f * (-0.5 + 0.5 * f));
}

// Adds the 12 pixels around the four to a light that is interpolated without blurring. Returns false
// if one of them is missing.
bool add_around(ivec2 low, vec4 wx, vec4 wy, Wanted wanted, inout vec3 light) {
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      if ((x == 1 || x == 2) && (y == 1 || y == 2)) continue;
      if (wx[x] * wy[y] == 0.0) continue;
      Kept there;
      if (!load_past(low + ivec2(x - 1, y - 1), wanted, there)) return false;
      light += wx[x] * wy[y] * there.light;
    }
  return true;
}

// Interpolates the history at the wanted place among the pixels that show the wanted surface. `most`
// is lowered to the number of frames for which it may be used.
bool interpolate(Wanted wanted, out Kept kept, inout float most) {
  kept = Kept(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), vec3(0.0));
  ivec2 low = ivec2(floor(wanted.at));
  vec2 f = wanted.at - vec2(low);
  low += ivec2(greaterThan(f, vec2(1.0 - SNAP)));
  f = mix(f, vec2(0.0), greaterThan(abs(f - 0.5), vec2(0.5 - SNAP)));
  const vec4 wx = sharp_weights(f.x);
  const vec4 wy = sharp_weights(f.y);
  float total = 0.0;
  vec3 sharp = vec3(0.0);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x) {
      const float weight = (x == 0 ? 1.0 - f.x : f.x) * (y == 0 ? 1.0 - f.y : f.y);
      Kept there;
      if (weight <= 0.0 || !load_past(low + ivec2(x, y), wanted, there)) continue;
      kept.light += weight * there.light;
      kept.doubt += weight * there.doubt;
      kept.square += weight * there.square;
      kept.mask += weight * there.mask;
      kept.uncovered += weight * there.uncovered;
      kept.albedo += weight * there.albedo;
      total += weight;
      sharp += wx[x + 1] * wy[y + 1] * there.light;
    }
  if (total < 0.05) return false;
  // The sums are left as they are where all are there: a mean of equal masks is the mask itself.
  if (total < 1.0) {
    kept.light /= total;
    kept.doubt /= total;
    kept.square /= total;
    kept.mask /= total;
    kept.uncovered /= total;
    kept.albedo /= total;
  }
  if (!wanted.is_edge) kept.mask = wanted.mask;
  const float blur = f.x * (1.0 - f.x) + f.y * (1.0 - f.y);
  if (blur <= 0.0) return true;
  if (!wanted.is_edge && total > 0.999 && add_around(low, wx, wy, wanted, sharp)) {
    kept.light = sharp;
    return true;
  }
  most = min(most, history.samples * (wanted.is_edge ? MOST_EDGE_BLUR : MOST_BLUR) / blur);
  return true;
}

// Finds the history of a pixel with this mean(M) and albedo, and lowers `most` to the samples that it
// counts as. Where an edge was and the picture stands still, the pixel becomes an edge.
bool find_history(ivec2 at, float mask, vec3 albedo, inout bool is_edge, out Kept past,
                  inout float most) {
  if (most <= 0.0) return false;
  Wanted wanted;
  const ivec2 source = is_edge ? nearest_around(at) : at;
  if (!find_before(at, source, wanted)) return false;
  most = min(most, places[in_picture(source)].w);
  const vec2 moved_by = abs(wanted.at - vec2(at));
  const bool stands_still = history.is_still != 0u && max(moved_by.x, moved_by.y) < STILL;
  if (!is_edge && stands_still && was_edge(wanted.at)) is_edge = true;
  wanted.mask = mask;
  wanted.albedo = albedo;
  wanted.is_edge = is_edge;
  return interpolate(wanted, past, most) && most >= LEAST_COUNTED;
}

// Keeps an edge as light.
Kept as_light(Kept k) {
  k.light *= k.albedo;
  k.square *= k.albedo * k.albedo;
  k.uncovered *= k.albedo;
  k.albedo = vec3(1.0);
  return k;
}

void store(uint index, Kept k, bool is_edge) {
  kept_lights[index] = vec4(k.light, k.doubt);
  kept_squares[index] = vec4(k.square, k.mask);
  kept_uncovered[index] = vec4(k.uncovered, is_edge ? 1.0 : 0.0);
  kept_albedos[index] = pack_halves(k.albedo);
}

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const uint in_band = show.in_band + gl_GlobalInvocationID.x;
  const uint index = show.in_picture + in_band;
  const ivec2 at = ivec2(index % history.width, index / history.width);
  const float samples = history.samples;
  Kept now;
  now.light = signals[in_band].rgb;
  now.square = (samples - 1.0) * variances[in_band].rgb + now.light * now.light;
  now.doubt = 1.0 / samples;
  now.mask = composites[in_band].w;
  now.uncovered = uncovered[in_band].rgb;
  now.albedo = unpack_halves(albedos[in_band]);
  bool is_edge = is_edge_now(at, now.mask);
  float most = history.most_samples;
  Kept past;
  const bool has_past = find_history(at, now.mask, now.albedo, is_edge, past, most);
  if (is_edge) now = as_light(now);
  if (!has_past) {
    store(index, now, is_edge);
    return;
  }
  const float doubt = max(past.doubt, 1.0 / most);
  const float share = samples / (samples + 1.0 / doubt);
  // Written as steps from the past, so that equal values stay what they are to the last bit.
  Kept mean;
  mean.light = past.light + share * (now.light - past.light);
  mean.square = past.square + share * (now.square - past.square);
  mean.mask = past.mask + share * (now.mask - past.mask);
  mean.uncovered = past.uncovered + share * (now.uncovered - past.uncovered);
  mean.albedo = past.albedo + share * (now.albedo - past.albedo);
  mean.doubt = (1.0 - share) * (1.0 - share) * doubt + share * share / samples;
  if (mean.mask < LEAST_SHARE) mean.mask = 0.0;
  if (mean.mask > 1.0 - LEAST_SHARE) mean.mask = 1.0;
  store(index, mean, is_edge);
}
