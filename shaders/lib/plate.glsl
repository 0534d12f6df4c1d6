// The camera's picture as its codes.
#ifndef PREVIZ_PLATE_GLSL
#define PREVIZ_PLATE_GLSL

#include "shaders/lib/render_shared.h"

// Samples of the whole picture, interleaved RGB, two in each word.
layout(scalar) readonly buffer PlateSamples { uint plate_samples[]; };

// Returns the codes of a pixel, which is counted row by row.
uvec3 plate_codes(uint pixel) {
  uvec3 codes;
  for (uint c = 0u; c < 3u; ++c) {
    const uint at = 3u * pixel + c;
    codes[c] = bitfieldExtract(plate_samples[at / 2u], int(at % 2u) * 16, 16);
  }
  return codes;
}

#endif
