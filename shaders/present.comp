// Turns the composite into codes as the display shows them, by exposure and response. An invocation
// works on two pixels, whose six codes are three words. Where nothing virtual touches a pixel, it
// keeps the codes of the plate. Elsewhere codes may be dithered: a difference of the worlds of a third
// of a code, over a wide surface, would otherwise be lost or be shown as a whole one (shaders/README.md,
// "The composite").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/show.glsl"

layout(scalar) readonly buffer Composites { vec4 composites[]; };  // as composite.comp writes them
layout(scalar) readonly buffer Signals { vec4 signals[]; };        // denoised, and so are the next two
layout(scalar) readonly buffer Uncovered { vec4 uncovered[]; };
layout(scalar) readonly buffer Reals { vec4 reals[]; };
layout(scalar) readonly buffer Highlights { uint highlights[]; };
layout(scalar) readonly buffer Caustics { vec4 caustics[]; };    // what the signals are without
// DITHER_SIDE^2 thresholds between 0 and 1, of blue noise (daemon/render/blue_noise.hpp).
layout(scalar) readonly buffer Thresholds { float thresholds[]; };
layout(scalar) buffer Control { GpuControl control; };
layout(scalar) writeonly buffer Picture { uint picture[]; };     // samples, as the plate's

// Returns the code below or above `signal`, so that the mean over the pattern's pixels is the signal
// itself. Each channel has the pattern at another place, so that they are not raised together.
uint dithered_code_of(float signal, uvec2 at, uint channel) {
  const uint code = code_of(signal, show.most, false);
  if (code == show.most || !(signal > 0.0)) return code;
  const float share = (signal - signal_of[code]) / (signal_of[code + 1u] - signal_of[code]);
  const uvec2 in_pattern = (at + channel * uvec2(23u, 41u)) % DITHER_SIDE;
  return share > thresholds[in_pattern.y * DITHER_SIDE + in_pattern.x] ? code + 1u : code;
}

// Returns the composite without noise. A channel that was white stays as it was where it is a
// highlight, or comes out above NEARLY_WHITE and was not cut by the denoiser.
vec3 without_noise(vec3 composite, vec3 clean, uint highlight) {
  for (uint c = 0u; c < 3u; ++c) {
    const bool is_bright = clean[c] >= NEARLY_WHITE * show.white &&
                           composite[c] <= DENOISE_MOST_WHITES * show.white;
    const bool stays = (highlight & (1u << c)) != 0u || is_bright;
    if (composite[c] < show.white || !stays) composite[c] = clean[c];
  }
  return composite;
}

uvec3 codes_of(uint pixel) {
  const uint index = show.in_band + pixel;
  const vec4 shown = composites[index];
  const float mask = shown.w;
  const vec3 signal = signals[index].rgb;
  const vec3 rest = show.has_caustics != 0u ? caustics[index].rgb : vec3(0.0);
  if (show.has_plate != 0u && mask == 0.0 && signal == vec3(0.0) && rest == vec3(0.0))
    return plate_codes(show.in_picture + index);
  vec3 radiance = shown.rgb;
  if (show.is_denoised != 0u) {
    const Estimate estimate = Estimate(show.white * signal, mask, show.white * uncovered[index].rgb,
                                       show.white * reals[index].rgb);
    radiance = without_noise(radiance, compose(measured_at(index), estimate), highlights[index]);
  }
  if (any(lessThan(radiance, vec3(0.0)))) atomicAdd(control.below_zero, 1u);
  const vec3 exposed = show.exposure * radiance;
  if (show.is_dithered == 0u)
    return uvec3(code_of(exposed.r, show.most, true), code_of(exposed.g, show.most, true), code_of(exposed.b, show.most, true));
  const uint in_picture = show.in_picture + index;
  const uvec2 at = uvec2(in_picture % show.width, in_picture / show.width);
  return uvec3(dithered_code_of(exposed.r, at, 0u), dithered_code_of(exposed.g, at, 1u),
               dithered_code_of(exposed.b, at, 2u));
}

void main() {
  const uint first = 2u * gl_GlobalInvocationID.x;
  if (first >= show.count) return;
  const uvec3 a = codes_of(first);
  const uvec3 b = first + 1u < show.count ? codes_of(first + 1u) : uvec3(0u);
  const uint word = 3u * gl_GlobalInvocationID.x;
  picture[word] = a.r | a.g << 16u;
  picture[word + 1u] = a.b | b.r << 16u;
  picture[word + 2u] = b.g | b.b << 16u;
}
