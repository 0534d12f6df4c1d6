// One level of an edge-avoiding wavelet transform that is guided by variance. The kernel is a B3
// spline over 5x5 pixels that are `step` apart. A neighbour's weight falls the less it shows the
// same surface, and the more its guide differs than noise explains (Dammertz et al. 2010,
// "Edge-Avoiding A-Trous Wavelet Transform"; Schied et al. 2017, "Spatiotemporal Variance-Guided
// Filtering").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

// denoise_guide.comp makes the guide; w: its variance, the mean over the channels.
PREVIZ_FETCHED(vec4, guides)
PREVIZ_FETCHED(vec4, reals)  // mean(Lr), over white and albedo, gets the signal's weights
layout(scalar) writeonly buffer DenoisedSignals { vec4 denoised_signals[]; };
layout(scalar) writeonly buffer DenoisedVariances { vec4 denoised_variances[]; };
layout(scalar) writeonly buffer DenoisedReals { vec4 denoised_reals[]; };

// A neighbour's weight has fallen to 1 / e where its guide is off by so many standard deviations. A
// larger number blurs detail, a smaller one leaves noise. Light that changes on real surfaces has
// soft edges, and little of it is seen by few samples; virtual objects have detail of their own.
// The standard deviations are those of independent neighbours (tests/truth/RESULTS.md).
const float CHANGE_NOISE_SCALE = 8.0;
const float OBJECT_NOISE_SCALE = 3.0;
// The further apart two pixels of a real surface are, the likelier it is that they do differ. So
// CHANGE_NOISE_SCALE is multiplied by this power of the step, and for guides by the square of that,
// because a guide shows soft edges before values do. Otherwise far steps spread a contact shadow over
// the light around.
const float FALL_WITH_STEP = -0.25;
// The least variance of a signal, in units of the sensor's white squared: far below what 16 bits
// show.
const float LEAST_VARIANCE = 1e-12;

// Neighbours that earlier levels have blended share pixels. With full weights, the spline is worth
// 13.4 neighbours, (sum w)^2 / sum w^2. Of so many independent neighbours a level would leave 1 /
// 13.4 of the variance, but of overlapping ones it leaves a quarter. So the variance is taken to
// fall with this power of the number: 13.4^0.535 = 4.
const float OVERLAP_POWER = 0.535;

const float SPLINE[3] = float[3](0.375, 0.25, 0.0625);

// Returns the squared difference of two guides over the one that noise alone would cause.
float guide_distance(vec4 a, vec4 b, float scale) {
  const vec3 off = a.rgb - b.rgb;
  return dot(off, off) / (3.0 * (scale * scale * (a.w + b.w) + LEAST_VARIANCE));
}

// Returns the same of two pixels, as a mean over the channels.
float value_distance(Pixel a, Pixel b, float scale) {
  const vec3 off = a.signal - b.signal;
  const vec3 expected = scale * scale * (a.variance + b.variance) + LEAST_VARIANCE;
  return dot(off * off / expected, vec3(1.0 / 3.0));
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Pixel here = load_pixel(at);
  const vec4 guide = fetch(guides, int(index));
  // The guide lies between pixels, and does not see what is finer than its step. Where pixels know
  // their variance, their values show that.
  const float fall = pow(float(denoise.step), FALL_WITH_STEP);
  const bool is_object = here.cover > 0.0;
  const float value_scale = is_object ? OBJECT_NOISE_SCALE : CHANGE_NOISE_SCALE * fall;
  const float guide_scale = is_object ? OBJECT_NOISE_SCALE : value_scale * fall;
  const vec2 slope = inverse_depth_slopes(at, here.inverse_depth);
  const bool has_companions = denoise.has_companions != 0u;
  vec3 change = vec3(0.0);
  vec3 variance = vec3(0.0);
  vec3 real = vec3(0.0);
  float overlap = 0.0;
  float total = 0.0;
  float squares = 0.0;
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x) {
      const ivec2 off = int(denoise.step) * ivec2(x, y);
      if (!is_inside(at + off)) continue;
      const Pixel there = load_pixel(at + off);
      float weight = SPLINE[abs(x)] * SPLINE[abs(y)];
      if (x != 0 || y != 0) {
        if (!are_alike(here, there, off)) continue;
        const float foretold = here.inverse_depth + dot(slope, vec2(off));
        float distance = guide_distance(guide, fetch(guides, pixel_index(at + off)), guide_scale) +
                         surface_distance(here, there, foretold);
        if (denoise.single_sample == 0u)
          distance += value_distance(here, there, value_scale);
        weight *= exp(-distance);
      }
      change += weight * (there.signal - here.signal);
      variance += weight * weight * there.variance;
      overlap += weight * there.overlap;
      total += weight;
      squares += weight * weight;
      if (has_companions) real += weight * fetch(reals, pixel_index(at + off)).rgb;
    }
  overlap /= total;
  if (denoise.step > 1u) overlap *= pow(total * total / squares, 1.0 - OVERLAP_POWER);
  denoised_signals[index] = vec4(here.signal + change / total, here.inverse_depth);
  denoised_variances[index] = vec4(variance / (total * total), overlap);
  if (!has_companions) return;
  denoised_reals[index] = vec4(real / total, 0.0);
}
