// Makes the guide of one level of the denoiser: the signal averaged over the 3x3 pixels of the same
// surface that are `step` apart. The level takes its weights from the guide and averages the signal
// itself. If a pixel's weights came from its own value, a sparse signal would lose light: a bright
// pixel would be counted little by its many dark neighbours, and they would gain less than it lost.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

layout(scalar) writeonly buffer Guides { vec4 guides[]; };  // w: its variance, the mean over the channels

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Pixel here = load_pixel(at);
  const vec2 slope = inverse_depth_slopes(at, here.inverse_depth);
  vec3 change = vec3(0.0);
  vec3 variance = vec3(0.0);
  float total = 0.0;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
      const ivec2 off = int(denoise.step) * ivec2(x, y);
      if (!is_inside(at + off)) continue;
      const Pixel there = load_pixel(at + off);
      if (!are_alike(here, there, off)) continue;
      const float foretold = here.inverse_depth + dot(slope, vec2(off));
      const float weight = exp(-surface_distance(here, there, foretold));
      change += weight * (there.signal - here.signal);
      variance += weight * weight * there.variance;
      total += weight;
    }
  guides[index] = vec4(here.signal + change / total, dot(variance, vec3(1.0 / 3.0)) / (total * total));
}
