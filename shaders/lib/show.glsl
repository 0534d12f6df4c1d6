// The passes that make the shown picture share the plate of a band and the denoiser's unit.
#ifndef PREVIZ_SHOW_GLSL
#define PREVIZ_SHOW_GLSL

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Show { GpuShow show; };
// Samples of the band, interleaved RGB, two in each word.
layout(scalar) readonly buffer PlateSamples { uint plate[]; };
// The linear signal of each code.
layout(scalar) readonly buffer SignalOf { float signal_of[]; };

// Returns the codes of the band's plate at a pixel.
uvec3 plate_codes(uint pixel) {
  uvec3 codes;
  for (uint c = 0u; c < 3u; ++c) {
    const uint at = 3u * pixel + c;
    codes[c] = bitfieldExtract(plate[at / 2u], int(at % 2u) * 16, 16);
  }
  return codes;
}

// Returns the linear radiance of codes; that of the largest code is white to the last bit.
vec3 radiance_of(uvec3 codes) {
  return show.white * vec3(signal_of[codes.r], signal_of[codes.g], signal_of[codes.b]);
}

// Returns the unit of the denoiser's signal: white or, where the composite multiplies the camera's
// picture, that picture, whose texture is then not blurred. A floor keeps light that is added to
// black.
vec3 denoise_unit(vec3 camera, float mask) {
  if (show.composite == COMPOSITE_ADDITIVE || mask > 0.0) return vec3(show.white);
  return camera + max(show.floor, 1e-3 * show.white);
}

#endif
