// Makes the plate's codes of the bytes that the camera delivered, as to_plate() (drivers/plate.hpp) does,
// bit for bit. An invocation works on two pixels, whose six codes are three words.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform CameraFrame { GpuCameraFrame camera; };
layout(scalar) readonly buffer CameraBytes { uint camera_bytes[]; };
// These terms are added up to a colour, in codes (drivers/convert/yuv.hpp): those of 256 codes of luma,
// then those of CHROMA_CODES eighths of a code of Cr for red, of Cb and Cr for green, of Cb for blue.
layout(scalar) readonly buffer YuvTerms { float yuv_terms[]; };
layout(scalar) writeonly buffer PlateSamples { uint plate_samples[]; };

const uint LUMA_CODES = 256u;
const uint CHROMA_CODES = 8u * 255u + 1u;

uint byte_at(uint index) {
  return bitfieldExtract(camera_bytes[index / 4u], int(index % 4u) * 8, 8);
}

uint sample_at(uint index) {
  if (camera.is_deep == 0u) return byte_at(index);
  return bitfieldExtract(camera_bytes[index / 2u], int(index % 2u) * 16, 16);
}

// Returns a sample of the mosaic, which is mirrored about the pixels at its edge.
int mosaic(int x, int y) {
  const ivec2 last = ivec2(camera.width, camera.height) - 1;
  const ivec2 at = max(last - abs(last - abs(ivec2(x, y))), 0);
  return int(sample_at(uint(at.y) * camera.width + uint(at.x)));
}

int mean(int a, int b) {
  return (a + b + 1) >> 1;
}

// The colours that a pixel's filter lets not through are means of the neighbours that have them, green of
// those along the weaker edge.
uvec3 colour_of_mosaic(int x, int y) {
  const int here = mosaic(x, y);
  const int left = mosaic(x - 1, y), right = mosaic(x + 1, y);
  const int above = mosaic(x, y - 1), below = mosaic(x, y + 1);
  const bool in_red_column = ((uint(x) ^ camera.red_x) & 1u) == 0u;
  const bool in_red_row = ((uint(y) ^ camera.red_y) & 1u) == 0u;
  if (in_red_column != in_red_row) {
    const int beside = mean(left, right), over = mean(above, below);
    return in_red_row ? uvec3(beside, here, over) : uvec3(over, here, beside);
  }
  const int green = abs(left - right) > abs(above - below) ? mean(above, below) : mean(left, right);
  const int corners = (mosaic(x - 1, y - 1) + mosaic(x + 1, y - 1) + mosaic(x - 1, y + 1) +
                       mosaic(x + 1, y + 1) + 2) >> 2;
  return in_red_row ? uvec3(here, green, corners) : uvec3(corners, green, here);
}

uint code_of(precise float value) {
  if (value <= 0.0) return 0u;
  precise const float half_up = value + 0.5;
  return value >= 255.0 ? 255u : uint(half_up);
}

// Chroma is sited on the even columns and linear between them.
uvec3 colour_of_yuv(uint x, uint y) {
  const uint chroma_width = (camera.width + 1u) / 2u;
  const uint first_cb = camera.width * camera.height;
  const uint first_cr = first_cb + chroma_width * camera.height;
  const uint left = y * chroma_width + x / 2u;
  const uint right = y * chroma_width + min(x / 2u + x % 2u, chroma_width - 1u);
  const uint cb = 4u * (byte_at(first_cb + left) + byte_at(first_cb + right));
  const uint cr = 4u * (byte_at(first_cr + left) + byte_at(first_cr + right));
  const float luma = yuv_terms[byte_at(y * camera.width + x)];
  precise const float red = luma + yuv_terms[LUMA_CODES + cr];
  precise const float some_green = luma + yuv_terms[LUMA_CODES + CHROMA_CODES + cb];
  precise const float green = some_green + yuv_terms[LUMA_CODES + 2u * CHROMA_CODES + cr];
  precise const float blue = luma + yuv_terms[LUMA_CODES + 3u * CHROMA_CODES + cb];
  return uvec3(code_of(red), code_of(green), code_of(blue));
}

uvec3 codes_of(uint pixel) {
  switch (camera.arrangement) {
    case CAMERA_RGB:
      return uvec3(byte_at(3u * pixel), byte_at(3u * pixel + 1u), byte_at(3u * pixel + 2u));
    case CAMERA_GRAY:
      return uvec3(sample_at(pixel));
    case CAMERA_BAYER:
      return colour_of_mosaic(int(pixel % camera.width), int(pixel / camera.width));
    default:
      return colour_of_yuv(pixel % camera.width, pixel / camera.width);
  }
}

void main() {
  const uint pair = camera.first + gl_GlobalInvocationID.x;
  const uint pixels = camera.width * camera.height;
  const uint first = 2u * pair;
  if (first >= pixels) return;
  const uvec3 a = codes_of(first);
  const uvec3 b = first + 1u < pixels ? codes_of(first + 1u) : uvec3(0u);
  plate_samples[3u * pair] = a.r | a.g << 16u;
  plate_samples[3u * pair + 1u] = a.b | b.r << 16u;
  plate_samples[3u * pair + 2u] = b.g | b.b << 16u;
}
