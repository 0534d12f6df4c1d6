// A picture while noise is taken out of it, in passes from one pair of buffers into the other, and
// how much two of its pixels show of the same surface.
#ifndef PREVIZ_DENOISE_GLSL
#define PREVIZ_DENOISE_GLSL

#extension GL_EXT_samplerless_texture_functions : require

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Denoise { GpuDenoise denoise; };
layout(set = 0, binding = BINDING_DENOISE_SIGNAL) uniform textureBuffer signals;
layout(set = 0, binding = BINDING_DENOISE_VARIANCE) uniform textureBuffer variances;
layout(set = 0, binding = BINDING_DENOISE_SURFACE) uniform textureBuffer surfaces;
layout(scalar, set = 0, binding = BINDING_DENOISED_SIGNAL) writeonly buffer DenoisedSignals {
  vec4 denoised_signals[];
};
layout(scalar, set = 0, binding = BINDING_DENOISED_VARIANCE) writeonly buffer DenoisedVariances {
  vec4 denoised_variances[];
};

// Differences at which a neighbour's weight has fallen to 1 / e: of the mask; of the normals' chord,
// squared; of the inverse depth from what the surface's slope foretells, over the depth.
const float MASK_SCALE = 0.05;
const float NORMAL_SCALE = 0.03;
const float DEPTH_SCALE = 0.01;

struct Pixel {
  vec3 signal;
  float inverse_depth;  // 0: the ray met nothing
  vec3 variance;        // as of independent neighbours
  float overlap;        // by how much more they vary together, because they were made of the same pixels
  vec3 normal;
  float cover;          // mean(M)
};

int pixel_index(ivec2 at) { return at.y * int(denoise.width) + at.x; }

bool is_inside(ivec2 at) {
  return all(greaterThanEqual(at, ivec2(0))) &&
         all(lessThan(at, ivec2(denoise.width, denoise.height)));
}

Pixel load_pixel(ivec2 at) {
  const int index = pixel_index(at);
  const vec4 signal = texelFetch(signals, index);
  const vec4 surface = texelFetch(surfaces, index);
  const vec4 variance = texelFetch(variances, index);
  return Pixel(signal.rgb, signal.w, variance.rgb, variance.w, surface.xyz, surface.w);
}

// The difference Lm - Lr is not blended with what covers it, nor a hit with a miss.
bool are_alike(Pixel a, Pixel b) {
  return (a.cover > 0.0) == (b.cover > 0.0) && (a.inverse_depth > 0.0) == (b.inverse_depth > 0.0);
}

// Change of the inverse depth, which is linear over the picture of a plane, to the next pixel, by
// the flatter side: the other may be another surface's.
float inverse_depth_slope(ivec2 at, ivec2 off, float here) {
  float slope = 3.4e38;
  for (int side = -1; side <= 1; side += 2) {
    const ivec2 next = at + side * off;
    if (!is_inside(next)) continue;
    const float change = float(side) * (texelFetch(signals, pixel_index(next)).w - here);
    if (abs(change) < abs(slope)) slope = change;
  }
  return slope;
}

// Squared distance of two pixels as parts of one surface; `foretold`: what the first one's slope
// says of the other's inverse depth.
float surface_distance(Pixel a, Pixel b, float foretold) {
  const float mask = (a.cover - b.cover) / MASK_SCALE;
  const vec3 chord = a.normal - b.normal;
  const float depth = a.inverse_depth > 0.0
                          ? (b.inverse_depth - foretold) / (DEPTH_SCALE * a.inverse_depth)
                          : 0.0;
  return mask * mask + dot(chord, chord) / NORMAL_SCALE + depth * depth;
}

#endif
