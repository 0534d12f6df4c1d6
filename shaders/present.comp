// Turns the composite into codes as the display shows them, by exposure and response. An invocation
// works on two pixels, whose six codes are three words. Where nothing virtual touches a pixel, it
// keeps the codes of the plate. Elsewhere codes may be dithered: a difference of the worlds of a third
// of a code, over a wide surface, would otherwise be lost or be shown as a whole one (shaders/README.md,
// "The composite").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/dither.glsl"
#include "shaders/lib/show.glsl"

layout(scalar) readonly buffer Composites { vec4 composites[]; };  // as composite.comp writes them
layout(scalar) readonly buffer Signals { vec4 signals[]; };        // denoised, and so are the next two
layout(scalar) readonly buffer Uncovered { vec4 uncovered[]; };
layout(scalar) readonly buffer Reals { vec4 reals[]; };
layout(scalar) readonly buffer Highlights { uint highlights[]; };
layout(scalar) readonly buffer Caustics { vec4 caustics[]; };    // what the signals are without
layout(scalar) buffer Control { GpuControl control; };
layout(scalar) writeonly buffer Picture { uint picture[]; };     // samples, as the plate's
// The signal that is added to what is left of the plate at each pixel of the picture, and the mask. With
// show.is_enlarged it is written in place of the picture.
layout(scalar) writeonly buffer Additions { vec4 additions[]; };

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

// Returns the radiance of a pixel that something virtual touches.
vec3 radiance_of_pixel(uint index) {
  const vec4 shown = composites[index];
  if (show.is_denoised == 0u) return shown.rgb;
  const Estimate estimate = Estimate(show.white * signals[index].rgb, shown.w,
                                     show.white * uncovered[index].rgb, show.white * reals[index].rgb);
  return without_noise(shown.rgb, compose(measured_at(index), estimate), highlights[index]);
}

bool is_untouched(uint index) {
  const vec3 rest = show.has_caustics != 0u ? caustics[index].rgb : vec3(0.0);
  return show.has_plate != 0u && composites[index].w == 0.0 && signals[index].rgb == vec3(0.0) &&
         rest == vec3(0.0);
}

vec3 counted(vec3 radiance) {
  if (any(lessThan(radiance, vec3(0.0)))) atomicAdd(control.below_zero, 1u);
  return radiance;
}

uvec3 codes_of(uint pixel) {
  const uint index = show.in_band + pixel;
  const uint in_picture = show.in_picture + index;
  if (is_untouched(index)) return plate_codes(in_picture);
  const uvec2 at = uvec2(in_picture % show.width, in_picture / show.width);
  return shown_codes_of(show.exposure * counted(radiance_of_pixel(index)), show.most, at,
                        show.is_dithered != 0u);
}

void add(uint pixel) {
  const uint index = show.in_band + pixel;
  const uint in_picture = show.in_picture + index;
  const float mask = composites[index].w;
  vec3 radiance = vec3(0.0);
  if (!is_untouched(index))
    radiance = counted(radiance_of_pixel(index)) - (1.0 - mask) * radiance_of(plate_codes(in_picture));
  additions[in_picture] = vec4(show.exposure * radiance, mask);
}

void main() {
  const uint first = 2u * gl_GlobalInvocationID.x;
  if (first >= show.count) return;
  if (show.is_enlarged != 0u) {
    add(first);
    if (first + 1u < show.count) add(first + 1u);
    return;
  }
  const uvec3 a = codes_of(first);
  const uvec3 b = first + 1u < show.count ? codes_of(first + 1u) : uvec3(0u);
  const uint word = 3u * gl_GlobalInvocationID.x;
  picture[word] = a.r | a.g << 16u;
  picture[word + 1u] = a.b | b.r << 16u;
  picture[word + 2u] = b.g | b.b << 16u;
}
