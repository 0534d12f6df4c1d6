// Makes what a screen shows of the picture's codes: 8 bits a channel, rounded to nearest, and opaque.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform ScanOut { GpuScanOut scan_out; };
layout(scalar) readonly buffer Picture { uint picture[]; };  // samples, as the plate's
layout(scalar) writeonly buffer Screen { uint screen[]; };   // a pixel in each word, red lowest

uint byte_of(uint index) {
  const uint code = bitfieldExtract(picture[index / 2u], int(index % 2u) * 16, 16);
  return scan_out.is_deep != 0u ? (code * 255u + 32767u) / 65535u : code;
}

void main() {
  const uint pixel = gl_GlobalInvocationID.x;
  if (pixel >= scan_out.count) return;
  const uint first = 3u * pixel;
  screen[pixel] = byte_of(first) | byte_of(first + 1u) << 8u | byte_of(first + 2u) << 16u | 0xff000000u;
}
