// Makes the composite of each pixel from its sums and the plate, in single precision, and the input
// of the denoiser: what the composite is made of, because its rule is not linear and follows once
// more when noise has been taken out (shaders/README.md, "The composite").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/halves.glsl"
#include "shaders/lib/show.glsl"

layout(scalar) readonly buffer Pixels { GpuPixel pixels[]; };  // of a tile
layout(scalar) readonly buffer PixelCaustics { vec4 pixel_caustics[]; };  // likewise, with has_caustics
layout(scalar) writeonly buffer Composites { vec4 composites[]; };  // of the band: composite, mean(M)
// The denoiser's, as lib/denoise.glsl reads them.
layout(scalar) writeonly buffer Signals { vec4 signals[]; };
layout(scalar) writeonly buffer Variances { vec4 variances[]; };
layout(scalar) writeonly buffer Surfaces { vec4 surfaces[]; };
layout(scalar) writeonly buffer Uncovered { vec4 uncovered[]; };
layout(scalar) writeonly buffer Reals { vec4 reals[]; };
layout(scalar) writeonly buffer Albedos { uvec2 albedos[]; };  // as lib/halves.glsl
layout(scalar) writeonly buffer Caustics { vec4 caustics[]; };  // over white; variance
// For each pixel of the band, the bits of channels that are brighter than white by more than chance
// (bit 0: red).
layout(scalar) writeonly buffer Highlights { uint highlights[]; };

// Returns the variance of a mean of independent samples.
vec3 variance_of_mean(vec3 mean, vec3 square, float samples) {
  if (samples < 2.0) return vec3(0.0);
  return max(square - mean * mean, vec3(0.0)) / (samples - 1.0);
}

// Returns the variance of the change. A sample adds Lm in place of Lc where it is covered, and
// Lm - Lr where it is not.
vec3 variance_of_change(vec3 change, vec3 own, vec3 square, float mask, vec3 camera,
                        float samples) {
  if (mask <= 0.0 || mask >= 1.0) return variance_of_mean(change, square, samples);
  return variance_of_mean(change - mask * camera,
                          square + camera * (mask * camera - 2.0 * (change - own)), samples);
}

// Returns the channels that are brighter than white by more than two standard errors: a reflection
// of a lamp, and no outlier that a single sample of many met.
uint highlight_bits(vec3 above_white, vec3 variance) {
  uint bits = 0u;
  if (show.is_single != 0u) return bits;
  for (uint c = 0u; c < 3u; ++c)
    if (above_white[c] > 2.0 * sqrt(variance[c])) bits |= 1u << c;
  return bits;
}

// The least albedo that a pixel's light is divided by.
const float LEAST_ALBEDO = 0.02;

// Returns the albedo of what the pixel shows, as halves keep it. An edge has two, and a pixel of a
// scene without textures has none, for which the result is 1.
uvec2 albedo_of(GpuPixel sums, float mask) {
  const bool is_edge = mask > 0.0 && mask < 1.0;
  vec3 albedo = vec3(1.0);
  if (!is_edge && sums.normal.w > 0.0 && any(greaterThan(sums.albedo.rgb, vec3(0.0))))
    albedo = max(sums.albedo.rgb / sums.normal.w, LEAST_ALBEDO);
  return pack_halves(albedo);
}

// Returns the part of the change that photons have brought to what the pixel shows, which is not
// filtered: an edge has two surfaces, and keeps it. The fourth component is its variance.
vec4 caustic_of(float mask, float samples) {
  if (show.has_caustics == 0u || (mask > 0.0 && mask < 1.0)) return vec4(0.0);
  const vec4 sum = pixel_caustics[show.in_tile + gl_GlobalInvocationID.x];
  return sum / vec4(vec3(samples), samples * samples);
}

// The filter of photons' light takes no more than this in either direction, in whites.
const float MOST_CAUSTIC = 1e12;

vec4 over_white(vec4 caustic) {
  const vec3 light = clamp(caustic.rgb / show.white, -MOST_CAUSTIC, MOST_CAUSTIC);
  return vec4(light, min(caustic.w / show.white / show.white, MOST_CAUSTIC * MOST_CAUSTIC));
}

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const GpuPixel sums = pixels[show.in_tile + gl_GlobalInvocationID.x];
  const uint index = show.in_band + gl_GlobalInvocationID.x;
  const float samples = max(sums.square_high.w + sums.square_low.w, 1.0);
  const vec4 mixed = (sums.mixed_high + sums.mixed_low) / samples;
  const vec4 diff = (sums.diff_high + sums.diff_low) / samples;
  const vec4 own = (sums.uncovered_high + sums.uncovered_low) / samples;
  const vec3 square = (sums.square_high.rgb + sums.square_low.rgb) / samples;
  const float mask = mixed.w;
  const Measured camera = measured_at(index);
  const vec3 change = mask * mixed.rgb + (1.0 - mask) * diff.rgb;
  // Where only the difference was traced, the camera's measurement stands for the real world.
  const vec3 traced = ((sums.mixed_high.rgb - sums.diff_high.rgb) +
                       (sums.mixed_low.rgb - sums.diff_low.rgb)) / samples;
  const vec3 real = own.w > 0.0 ? camera.radiance : traced;
  const vec3 composite = compose(camera, Estimate(change, mask, own.rgb, real));
  composites[index] = vec4(composite, mask);
  const uvec2 halves = albedo_of(sums, mask);
  const vec3 albedo = unpack_halves(halves);  // what is divided by is what is multiplied with
  albedos[index] = halves;
  const vec4 of_photons = caustic_of(mask, samples);
  const vec3 caustic = of_photons.rgb;
  if (show.has_caustics != 0u) caustics[index] = over_white(of_photons);
  const vec3 own_left = mask > 0.0 ? own.rgb : own.rgb - caustic;
  uncovered[index] = vec4(own_left / show.white / albedo, 0.0);
  reals[index] = vec4(real / show.white / albedo, 0.0);

  const float hits = sums.normal.w;
  const float depth = hits > 0.0 ? diff.w * samples / hits : 0.0;
  const vec3 variance = variance_of_change(change, own.rgb, square, mask, camera.radiance, samples);
  vec3 gains;  // of an error of the change in the composite
  for (uint i = 0u; i < 3u; ++i)
    gains[i] = mix(gain(camera.radiance[i], real[i], camera.variance[i]), 1.0, mask);
  const uint bits = highlight_bits(composite - show.white, gains * gains * variance);
  highlights[index] = bits;
  signals[index] = vec4(min((change - caustic) / show.white, vec3(DENOISE_MOST_WHITES)) / albedo,
                        depth > 0.0 ? 1.0 / depth : 0.0);
  variances[index] = vec4(min(variance, vec3(show.most_variance)) / (show.white * show.white) /
                              (albedo * albedo), 0.0);
  // A highlight on a real surface, the core of a caustic, is shown as it is, and must not brighten
  // its neighbours too.
  surfaces[index] = vec4(hits > 0.0 ? sums.normal.xyz / hits : vec3(0.0),
                         bits != 0u && mask == 0.0 ? DENOISE_HIGHLIGHT : mask);
}
