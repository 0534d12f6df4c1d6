// One level of the filter of photons' light, which is apart from all other light because its edges are
// as sharp as a focus and its noise is another one: that of a few photons around a pixel, whose own
// number says how much they may be off (lib/gather.glsl). So it is blended far where photons are few,
// and hardly where they are many (shaders/README.md, "Denoising").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

PREVIZ_FETCHED(vec4, caustics)  // over white; variance
layout(scalar) writeonly buffer DenoisedCaustics { vec4 denoised_caustics[]; };

// A neighbour's weight has fallen to 1 / e where it is off by so many standard deviations.
const float NOISE_SCALE = 5.0;
const float LEAST_VARIANCE = 1e-12;
const float SPLINE[3] = float[3](0.375, 0.25, 0.0625);

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Pixel here = load_pixel(at);
  const vec4 own = fetch(caustics, int(index));
  const vec2 slope = inverse_depth_slopes(at, here.inverse_depth);
  vec3 sum = vec3(0.0);
  float variance = 0.0;
  float total = 0.0;
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x) {
      const ivec2 off = int(denoise.step) * ivec2(x, y);
      if (!is_inside(at + off)) continue;
      const Pixel there = load_pixel(at + off);
      if (!are_alike(here, there, off)) continue;
      const vec4 other = fetch(caustics, pixel_index(at + off));
      const vec3 by = other.rgb - own.rgb;
      const float foretold = here.inverse_depth + dot(slope, vec2(off));
      const float noise = NOISE_SCALE * NOISE_SCALE * (own.w + other.w) + LEAST_VARIANCE;
      const float distance = dot(by, by) / (3.0 * noise) + surface_distance(here, there, foretold);
      const float weight = SPLINE[abs(x)] * SPLINE[abs(y)] * exp(-distance);
      sum += weight * by;
      variance += weight * weight * other.w;
      total += weight;
    }
  denoised_caustics[index] = vec4(own.rgb + sum / total, variance / (total * total));
}
