// Makes the composite of each pixel from its sums and the plate, in single precision, and the input
// of the denoiser. The rule is that of daemon/render/composite.hpp (shaders/README.md, "The
// composite").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/show.glsl"

layout(scalar) readonly buffer Pixels { GpuPixel pixels[]; };       // of a tile
layout(scalar) writeonly buffer Composites { vec4 composites[]; };  // of the band: composite, mean(M)
// The denoiser's, as lib/denoise.glsl reads them.
layout(scalar) writeonly buffer Signals { vec4 signals[]; };
layout(scalar) writeonly buffer Variances { vec4 variances[]; };
layout(scalar) writeonly buffer Surfaces { vec4 surfaces[]; };

// Gains are limited to this: a larger ratio means nothing, and its square would overflow.
const float MOST_GAIN = 1e15;

// Returns the variance that rounding to codes leaves in the plate: step^2 / 12, the variance of a
// uniform distribution, with the mean step to the two neighbouring codes.
vec3 plate_variance(uvec3 codes) {
  const uvec3 low = max(codes, 1u) - 1u;
  const uvec3 high = min(codes + 1u, show.most);
  const vec3 step = (radiance_of(high) - radiance_of(low)) / vec3(high - low);
  return step * step / 12.0;
}

// Returns the factor by which the difference is multiplied before it is added to the camera's
// radiance. For hybrid, both terms are first divided by the larger one, because their squares could
// overflow.
float gain(float camera, float real, float variance) {
  if (show.composite == COMPOSITE_RATIO) return real > 0.0 ? min(camera / real, MOST_GAIN) : 0.0;
  if (show.composite == COMPOSITE_HYBRID) {
    const float spread = sqrt(variance + show.floor * show.floor);
    const float most = max(real, spread);
    if (!(most > 0.0)) return 1.0;
    const float r = real / most;
    const float s = spread / most;
    return min((r * (camera / most) + s * s) / (r * r + s * s), MOST_GAIN);
  }
  return 1.0;
}

vec3 variance_of_mean(vec3 mean, vec3 square, float samples) {
  if (samples < 2.0) return vec3(0.0);
  return max(square - mean * mean, vec3(0.0)) / (samples - 1.0);
}

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const GpuPixel sums = pixels[show.in_tile + gl_GlobalInvocationID.x];
  const uint index = show.in_band + gl_GlobalInvocationID.x;
  const float samples = max(sums.square_diff_high.w + sums.square_diff_low.w, 1.0);
  vec4 mixed = (sums.mixed_high + sums.mixed_low) / samples;
  const vec4 diff = (sums.diff_high + sums.diff_low) / samples;
  const vec4 square_mixed = (sums.square_mixed_high + sums.square_mixed_low) / samples;
  const vec3 square_diff = (sums.square_diff_high.rgb + sums.square_diff_low.rgb) / samples;
  const float mask = mixed.w;

  vec3 camera = vec3(0.0);
  vec3 camera_variance = vec3(0.0);
  if (show.has_plate != 0u) {
    const uvec3 codes = plate_codes(index);
    camera = radiance_of(codes);
    if (show.composite == COMPOSITE_HYBRID) camera_variance = plate_variance(codes);
  }
  vec3 real = ((sums.mixed_high.rgb - sums.diff_high.rgb) +
               (sums.mixed_low.rgb - sums.diff_low.rgb)) / samples;
  // Where only the difference was traced, the camera's measurement stands for the real world.
  if (square_mixed.w > 0.0) {
    real = camera;
    mixed.rgb = camera + diff.rgb;
  }
  vec3 gains;
  for (uint c = 0u; c < 3u; ++c) gains[c] = gain(camera[c], real[c], camera_variance[c]);
  const float uncovered = 1.0 - mask;
  const vec3 composite = mask * mixed.rgb + uncovered * (camera + gains * diff.rgb);
  const vec3 variance =
      mask * mask * variance_of_mean(mixed.rgb, square_mixed.rgb, samples) +
      uncovered * uncovered * gains * gains * variance_of_mean(diff.rgb, square_diff, samples);
  composites[index] = vec4(composite, mask);

  const float hits = sums.normal.w;
  const float depth = hits > 0.0 ? diff.w * samples / hits : 0.0;
  const vec3 unit = denoise_unit(camera, mask);
  const vec3 through = uncovered * camera;
  const vec3 shown = min(composite, max(through, show.white));
  signals[index] = vec4((shown - through) / unit, depth > 0.0 ? 1.0 / depth : 0.0);
  variances[index] = vec4(min(variance, vec3(show.most_variance)) / unit / unit, 0.0);
  surfaces[index] = vec4(hits > 0.0 ? sums.normal.xyz / hits : vec3(0.0), mask);
}
