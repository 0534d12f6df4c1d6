// Turns the composite into codes as the display shows them, by exposure and response. An invocation
// works on two pixels, whose six codes are three words. Where nothing virtual touches a pixel, it
// keeps the codes of the plate.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/show.glsl"

// The least signal that becomes each code.
layout(scalar) readonly buffer LeastOf { float least_of[]; };
layout(scalar) readonly buffer Composites { vec4 composites[]; };  // as composite.comp writes them
layout(scalar) readonly buffer Signals { vec4 signals[]; };        // denoised, or as composited
layout(scalar) writeonly buffer Picture { uint picture[]; };       // samples, as the plate's

// Replaces the composite by its denoised signal. A channel that was white and comes out above
// NEARLY_WHITE stays as it was.
vec3 without_noise(vec3 composite, vec3 camera, float mask, vec3 signal) {
  const vec3 clean = (1.0 - mask) * camera + denoise_unit(camera, mask) * signal;
  for (uint c = 0u; c < 3u; ++c)
    if (composite[c] < show.white || clean[c] < NEARLY_WHITE * show.white) composite[c] = clean[c];
  return composite;
}

// Returns the largest code whose least signal is not above `signal`, and 0 for NaN.
uint code_of(float signal) {
  if (!(signal > 0.0)) return 0u;
  uint code = 0u;
  uint above = show.most + 1u;
  while (above - code > 1u) {
    const uint middle = (code + above) / 2u;
    if (least_of[middle] <= signal) code = middle;
    else above = middle;
  }
  return code;
}

uvec3 codes_of(uint pixel) {
  const uint index = show.in_band + pixel;
  const vec4 shown = composites[index];
  const vec3 signal = signals[index].rgb;
  vec3 camera = vec3(0.0);
  if (show.has_plate != 0u) {
    const uvec3 own = plate_codes(index);
    if (shown.w == 0.0 && signal == vec3(0.0)) return own;
    camera = radiance_of(own);
  }
  const vec3 radiance =
      show.is_denoised != 0u ? without_noise(shown.rgb, camera, shown.w, signal) : shown.rgb;
  const vec3 exposed = show.exposure * radiance;
  return uvec3(code_of(exposed.r), code_of(exposed.g), code_of(exposed.b));
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
