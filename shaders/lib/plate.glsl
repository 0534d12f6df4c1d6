// The camera's picture as its codes.
#ifndef PREVIZ_PLATE_GLSL
#define PREVIZ_PLATE_GLSL

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/render_shared.h"

// Samples of the whole picture, interleaved RGB, two in each word.
PREVIZ_FETCHED(uint, plate_samples)

// Returns the codes of a pixel, which is counted row by row.
uvec3 plate_codes(uint pixel) {
  uvec3 codes;
  for (uint c = 0u; c < 3u; ++c) {
    const uint at = 3u * pixel + c;
    codes[c] = bitfieldExtract(fetch(plate_samples, int(at / 2u)), int(at % 2u) * 16, 16);
  }
  return codes;
}

#endif
