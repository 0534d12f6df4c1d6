// Dithered codes of what is shown.
#ifndef PREVIZ_DITHER_GLSL
#define PREVIZ_DITHER_GLSL

#include "shaders/lib/render_shared.h"
#include "shaders/lib/response.glsl"

// DITHER_SIDE^2 thresholds between 0 and 1, of blue noise (daemon/core/render/picture/blue_noise.hpp).
layout(scalar) readonly buffer Thresholds { float thresholds[]; };

// Returns the code below or above `signal`, so that the mean over the pattern's pixels is the signal
// itself. Each channel has the pattern at another place, so that they are not raised together.
uint dithered_code_of(float signal, uint most, uvec2 at, uint channel) {
  const uint code = code_of(signal, most, false);
  if (code == most || !(signal > 0.0)) return code;
  const float share = (signal - signal_of[code]) / (signal_of[code + 1u] - signal_of[code]);
  const uvec2 in_pattern = (at + channel * uvec2(23u, 41u)) % DITHER_SIDE;
  return share > thresholds[in_pattern.y * DITHER_SIDE + in_pattern.x] ? code + 1u : code;
}

// Returns the codes of a pixel: dithered, or else rounded to nearest.
uvec3 shown_codes_of(vec3 signal, uint most, uvec2 at, bool is_dithered) {
  uvec3 codes;
  for (uint c = 0u; c < 3u; ++c)
    codes[c] = is_dithered ? dithered_code_of(signal[c], most, at, c) : code_of(signal[c], most, true);
  return codes;
}

#endif
