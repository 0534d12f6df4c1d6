// One level of an edge-avoiding wavelet transform that is guided by variance. The kernel is a B3
// spline over 5x5 pixels that are `step` apart. A neighbour's weight falls the less it shows the
// same surface, and the more it differs than its noise explains (Dammertz et al. 2010,
// "Edge-Avoiding A-Trous Wavelet Transform"; Schied et al. 2017, "Spatiotemporal Variance-Guided
// Filtering").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

// A neighbour's weight has fallen to 1 / e at a difference of so many standard deviations. A larger
// number blurs detail, a smaller one leaves noise; 1.5 to 3 differ little. The standard deviations
// are those of independent neighbours. If the overlap were included, coarse levels would blend
// more, and lose by blur what they gain in noise (tests/truth/RESULTS.md).
const float NOISE_SCALE = 2.0;
// The least variance of a signal, in units of the sensor's white squared: far below what 16 bits
// show.
const float LEAST_VARIANCE = 1e-12;

// Neighbours that earlier levels have blended share pixels. With full weights, the spline is worth
// 13.4 neighbours, (sum w)^2 / sum w^2. Of so many independent neighbours a level would leave 1 /
// 13.4 of the variance, but of overlapping ones it leaves a quarter. So the variance is taken to
// fall with this power of the number: 13.4^0.535 = 4.
const float OVERLAP_POWER = 0.535;

const float SPLINE[3] = float[3](0.375, 0.25, 0.0625);

// Returns the squared difference of two signals over the one that noise alone would cause, as a
// mean over the channels.
float signal_distance(Pixel a, Pixel b) {
  const vec3 off = a.signal - b.signal;
  const vec3 expected = NOISE_SCALE * NOISE_SCALE * (a.variance + b.variance) + LEAST_VARIANCE;
  return dot(off * off / expected, vec3(1.0 / 3.0));
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Pixel here = load_pixel(at);
  const vec2 slope = vec2(inverse_depth_slope(at, ivec2(1, 0), here.inverse_depth),
                          inverse_depth_slope(at, ivec2(0, 1), here.inverse_depth));
  vec3 change = vec3(0.0);
  vec3 variance = vec3(0.0);
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
        if (!are_alike(here, there)) continue;
        const float foretold = here.inverse_depth + dot(slope, vec2(off));
        weight *= exp(-(signal_distance(here, there) + surface_distance(here, there, foretold)));
      }
      change += weight * (there.signal - here.signal);
      variance += weight * weight * there.variance;
      overlap += weight * there.overlap;
      total += weight;
      squares += weight * weight;
    }
  overlap /= total;
  if (denoise.step > 1u) overlap *= pow(total * total / squares, 1.0 - OVERLAP_POWER);
  denoised_signals[index] = vec4(here.signal + change / total, here.inverse_depth);
  denoised_variances[index] = vec4(variance / (total * total), overlap);
}
