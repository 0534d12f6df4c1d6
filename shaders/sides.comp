// Parts what each pixel of a small rendering adds into its two sides, for enlarge.comp: that of the
// pixels around that are covered most, and that of those that are covered least. An outline's own
// pixels are a mixture of the two.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/halves.glsl"
#include "shaders/lib/plate.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Enlarge { GpuEnlarge enlarge; };
layout(scalar) readonly buffer Additions { vec4 additions[]; };   // as present.comp writes them
// In halves the light of the side that is covered most, then that of the other one; and in 8 bits each
// how much is covered of the pixel, of the first side, of the other, and the plate's brightness.
layout(scalar) writeonly buffer Sides { uvec4 sides[]; };

uint pixel_at(ivec2 at) {
  at = clamp(at, ivec2(0), ivec2(enlarge.from_width, enlarge.from_height) - 1);
  return uint(at.y) * enlarge.from_width + uint(at.x);
}

// Returns the light of one side: the pixel's own if it is wholly of that side, and else the mean of
// the nine around, of which the purest count most. The last components say from 0 to 1 how far each is
// of the side; the pixel itself is in the middle.
vec3 side_of(vec4 around[9]) {
  if (around[4].w >= 1.0) return around[4].rgb;
  vec4 sum = vec4(0.0);
  for (uint i = 0u; i < 9u; ++i) {
    const float pure = around[i].w * around[i].w;
    sum += max(pure * pure, ENLARGE_LEAST) * vec4(around[i].rgb, 1.0);
  }
  return sum.rgb / sum.w;
}

void main() {
  if (gl_GlobalInvocationID.x >= enlarge.from_width * enlarge.from_height) return;
  const uint pixel = gl_GlobalInvocationID.x;
  const ivec2 at = ivec2(pixel % enlarge.from_width, pixel / enlarge.from_width);
  vec4 around[9];
  float low = 1.0, high = 0.0;
  for (int i = 0; i < 9; ++i) {
    around[i] = additions[pixel_at(at + ivec2(i % 3 - 1, i / 3 - 1))];
    low = min(low, around[i].w);
    high = max(high, around[i].w);
  }
  const float mask = around[4].w;
  vec3 most = around[4].rgb, least = around[4].rgb;
  if (high > low) {
    for (uint i = 0u; i < 9u; ++i) around[i].w = (around[i].w - low) / (high - low);
    most = side_of(around);
    for (uint i = 0u; i < 9u; ++i) around[i].w = 1.0 - around[i].w;
    least = side_of(around);
  }
  const uvec3 codes = plate_codes(pixel);
  const float brightness = float(codes.r + codes.g + codes.b) / (3.0 * float(enlarge.most));
  sides[pixel] = uvec4(pack_four_halves(vec4(most, least.r)), packHalf2x16(least.gb),
                       packUnorm4x8(vec4(mask, high, low, brightness)));
}
