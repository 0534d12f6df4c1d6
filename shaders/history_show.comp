// Puts the history up to this frame in the place of what composite.comp has made of this frame alone:
// the composite, and the denoiser's input with its variance and number of samples. The denoiser gets the
// side at each pixel's middle, with the depth and the normal there, as if it filled the pixel, so that no
// pixel with a history is an edge to it; denoise_edges.comp mixes the two sides of an outline.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/halves.glsl"
#include "shaders/lib/history.glsl"
#include "shaders/lib/show.glsl"

// The history up to this frame, of the picture (history.comp).
layout(scalar) readonly buffer KeptLights { vec4 kept_lights[]; };
layout(scalar) readonly buffer KeptSpreads { uvec2 kept_spreads[]; };
layout(scalar) readonly buffer KeptAlbedos { uvec2 kept_albedos[]; };
layout(scalar) readonly buffer KeptOthers { uvec2 kept_others[]; };
layout(scalar) readonly buffer KeptCaustics { uvec2 kept_caustics[]; };
layout(scalar) readonly buffer Places { vec4 places[]; };    // history_surface.comp
layout(scalar) readonly buffer Things { uvec2 things[]; };
layout(scalar) readonly buffer Covers { float covers[]; };  // history_cover.comp
// Of the band, as composite.comp makes them.
layout(scalar) buffer Composites { vec4 composites[]; };
layout(scalar) buffer Signals { vec4 signals[]; };
layout(scalar) buffer Variances { vec4 variances[]; };  // w: number of samples
layout(scalar) buffer Surfaces { vec4 surfaces[]; };
layout(scalar) buffer Uncovered { vec4 uncovered[]; };  // an outline's: the other side, and its samples
layout(scalar) buffer Reals { vec4 reals[]; };
layout(scalar) buffer Albedos { uvec2 albedos[]; };  // w: 0, or 1 and the share that rays have found
layout(scalar) buffer Caustics { vec4 caustics[]; };

// A pixel without a sample of its own side has that of pixels so far away.
const int REACH = int(HISTORY_REACH);

// The side at the middle of a pixel.
struct Own {
  vec3 light;     // over white and albedo
  float samples;
  vec3 variance;  // of the mean
  vec3 albedo;
  vec4 caustic;   // over white; variance
};

Own load_own(uint index) {
  const vec4 kept = kept_lights[index];
  const vec3 deviation = unpack_four_halves(kept_spreads[index]).rgb;
  const vec4 caustic = unpack_four_halves(kept_caustics[index]);
  const vec3 albedo = unpack_halves(kept_albedos[index]);
  // The variance of a weighted mean is that of a sample times the sum of the squared weights, which
  // the mean square is short of (Bessel's correction).
  const float part = kept.w > 0.0 && kept.w < 0.999 ? kept.w / (1.0 - kept.w) : 0.0;
  return Own(kept.rgb, kept.w > 0.0 ? 1.0 / kept.w : 0.0, part * deviation * deviation, albedo,
             vec4(caustic.rgb, caustic.w * caustic.w));
}

// Returns the mean of those pixels around whose own side is `side` and whose albedo is known; with no
// samples if there are none.
Own own_of_neighbours(ivec2 at, float side) {
  Own sum = Own(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), vec4(0.0));
  float total = 0.0;
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      const ivec2 there = at + ivec2(x, y);
      if (any(lessThan(there, ivec2(0))) ||
          any(greaterThanEqual(there, ivec2(history.width, history.height))))
        continue;
      const uint index = there.y * history.width + there.x;
      if (class_of(things[index].x) != side || !(kept_lights[index].w > 0.0)) continue;
      const Own own = load_own(index);
      if (!is_known(own.albedo)) continue;
      const float near = 1.0 / float(x * x + y * y);
      sum.light += near * own.light;
      sum.variance += near * own.variance;
      sum.albedo += near * own.albedo;
      sum.caustic += near * own.caustic;
      total += near;
    }
  if (total <= 0.0) return sum;
  return Own(sum.light / total, 1.0, sum.variance / total, sum.albedo / total, sum.caustic / total);
}

// Returns the own side of a pixel, its light over an albedo. A pixel that has had no sample of it takes
// all from those around, and one that has only had samples of both sides together the albedo, which
// they do not know.
Own complete(uint index, float side) {
  const ivec2 at = ivec2(index % history.width, index / history.width);
  Own own = load_own(index);
  if (own.samples <= 0.0) return own_of_neighbours(at, side);
  if (is_known(own.albedo)) return own;
  const Own around = own_of_neighbours(at, side);
  own.albedo = around.samples > 0.0 ? around.albedo : vec3(1.0);
  own.light /= own.albedo;
  own.variance /= own.albedo * own.albedo;
  return own;
}

// The number of its samples is all that a frame that stands alone lacks.
void stand_alone(uint in_band) { variances[in_band].w = history.samples; }

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const uint in_band = show.in_band + gl_GlobalInvocationID.x;
  const uint index = show.in_picture + in_band;
  const float side = class_of(things[index].x);
  const float cover = covers[index];
  if (!has_sides(side, cover)) {
    stand_alone(in_band);
    return;
  }
  const bool is_mixed_anew = show.is_denoised != 0u && cover != COVER_UNKNOWN;
  const bool has_samples = kept_lights[index].w > 0.0;
  Own own = complete(index, side);
  if (own.samples <= 0.0 || !(has_samples || is_mixed_anew)) {
    stand_alone(in_band);
    return;
  }
  const vec4 other = unpack_four_halves(kept_others[index]);
  const float mask = is_mixed_anew ? side : unpack_four_halves(kept_spreads[index]).w;
  const vec3 real = reals[in_band].rgb * unpack_halves(albedos[in_band]);
  vec3 left = vec3(0.0);  // of the change, where nothing virtual covers the pixel
  if (mask != side) {
    // Two surfaces have no albedo in common.
    const vec3 whole = own.light * own.albedo + own.caustic.rgb;
    left = (1.0 - mask) * (side > 0.5 ? other.rgb : whole);
    own.light = left + mask * (side > 0.5 ? whole : other.rgb);
    // A sample is of one of the two, by chance.
    const vec3 apart = whole - other.rgb;
    own.variance = own.variance * own.albedo * own.albedo +
                   mask * (1.0 - mask) / (own.samples + abs(other.w)) * apart * apart;
    own.albedo = vec3(1.0);
    own.caustic = vec4(0.0);
  } else if (mask <= 0.0) {
    left = own.light;
  }
  const vec3 lit = mask <= 0.0 ? own.caustic.rgb : vec3(0.0);
  const Estimate estimate =
      Estimate(show.white * (own.albedo * own.light + own.caustic.rgb), mask,
               show.white * (own.albedo * left + lit), show.white * real);
  composites[in_band] = vec4(compose(measured_at(in_band), estimate), mask);
  const uvec2 thing = things[index];
  const bool shows_thing = thing.x != pack_thing(NO_THING, 0u, 0u);
  // A mirror's own depth is that of the frame's samples: what it shows lies anywhere.
  const float inverse_depth = is_seen_in_mirror(thing.x) ? signals[in_band].w
                              : shows_thing ? 1.0 / dot(places[index].xyz, history.forward)
                                            : 0.0;
  signals[in_band] = vec4(own.light, inverse_depth);
  uncovered[in_band] = vec4(left, 0.0);
  reals[in_band] = vec4(real / own.albedo, 0.0);
  albedos[in_band] = pack_four_halves(vec4(own.albedo, 0.0));
  if (show.has_caustics != 0u) caustics[in_band] = own.caustic;
  if (is_mixed_anew) {
    composites[in_band] = vec4(vec3(0.0), cover);
    uncovered[in_band] = vec4(other.rgb, abs(other.w));
    albedos[in_band] = pack_four_halves(vec4(own.albedo, 1.0 + cover));
  }
  const float shown = surfaces[in_band].w == DENOISE_HIGHLIGHT && !is_mixed_anew ? DENOISE_HIGHLIGHT : mask;
  surfaces[in_band] = vec4(shows_thing ? shading_of(thing.y) : vec3(0.0), shown);
  variances[in_band] = vec4(own.variance, own.samples);
}
