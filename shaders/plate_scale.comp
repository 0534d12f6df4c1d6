// Makes a smaller plate: each pixel has the mean of the linear signal over its area. An invocation works
// on two pixels, whose six codes are three words.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/plate.glsl"
#include "shaders/lib/response.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform PlateScale { GpuPlateScale scale; };
layout(scalar) writeonly buffer SmallSamples { uint small_samples[]; };

// Returns how much of a pixel's side lies in the `index`-th part of `parts` equal parts of all `pixels`, in
// units of a side over `parts`.
uint overlap(uint pixel, uint pixels, uint index, uint parts) {
  return min((pixel + 1u) * parts, (index + 1u) * pixels) - max(pixel * parts, index * pixels);
}

vec3 mean_of_row(uint y, uint column) {
  const uint first = column * scale.from_width / scale.width;
  const uint last = ((column + 1u) * scale.from_width - 1u) / scale.width;
  vec3 sum = vec3(0.0);
  for (uint x = first; x <= last; ++x) {
    const uvec3 codes = plate_codes(y * scale.from_width + x);
    sum += float(overlap(x, scale.from_width, column, scale.width)) *
           vec3(signal_of[codes.r], signal_of[codes.g], signal_of[codes.b]);
  }
  return sum / float(scale.from_width);
}

uvec3 codes_of(uint pixel) {
  const uint column = pixel % scale.width, row = pixel / scale.width;
  const uint first = row * scale.from_height / scale.height;
  const uint last = ((row + 1u) * scale.from_height - 1u) / scale.height;
  vec3 sum = vec3(0.0);
  for (uint y = first; y <= last; ++y)
    sum += float(overlap(y, scale.from_height, row, scale.height)) * mean_of_row(y, column);
  const vec3 mean = sum / float(scale.from_height);
  return uvec3(code_of(mean.r, scale.most, true), code_of(mean.g, scale.most, true),
               code_of(mean.b, scale.most, true));
}

void main() {
  const uint pair = scale.first + gl_GlobalInvocationID.x;
  const uint pixels = scale.width * scale.height;
  const uint first = 2u * pair;
  if (first >= pixels) return;
  const uvec3 a = codes_of(first);
  const uvec3 b = first + 1u < pixels ? codes_of(first + 1u) : uvec3(0u);
  small_samples[3u * pair] = a.r | a.g << 16u;
  small_samples[3u * pair + 1u] = a.b | b.r << 16u;
  small_samples[3u * pair + 2u] = b.g | b.b << 16u;
}
