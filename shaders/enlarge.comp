// Puts what a small rendering adds onto the camera's whole picture, which so stays as sharp as it is
// (shaders/README.md, "A smaller rendering"; daemon/core/render/picture/enlarge.cpp has it in double precision). An
// invocation works on two pixels, whose six codes are three words.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/dither.glsl"
#include "shaders/lib/halves.glsl"
#include "shaders/lib/plate.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Enlarge { GpuEnlarge enlarge; };
layout(scalar) readonly buffer Sides { uvec4 sides[]; };      // as sides.comp writes them
layout(scalar) writeonly buffer Picture { uint picture[]; };  // samples, as the plate's

// A small pixel's two sides.
struct Addition {
  vec3 most, least;  // signal that is added to what is left of the plate
  float mask;
  float high, low;   // how much of each side is covered
  float brightness;  // of the small plate
};

Addition addition_of(uvec4 bits) {
  const vec4 first = unpack_four_halves(bits.xy), rest = unpackUnorm4x8(bits.w);
  return Addition(first.rgb, vec3(first.a, unpackHalf2x16(bits.z)), rest.x, rest.y, rest.z, rest.w);
}

// Returns how much of a pixel belongs to the side that is covered most, where so much of it is covered:
// an outline is as sharp as one pixel of the whole picture.
float share_of(float mask, float low, float range) {
  if (!(range > 0.0)) return 1.0;
  return clamp(((mask - low) / range - 0.5) * enlarge.sharpness + 0.5, 0.0, 1.0);
}

float likeness(float off) { return max(1.0 - abs(off), ENLARGE_LEAST); }

// Returns the signal between four small pixels, over a plate of the signal and of the brightness.
vec3 signal_over(vec3 plate, float brightness, Addition around[4], vec4 weights) {
  float mask = 0.0, low = 1.0, high = 0.0;
  for (uint i = 0u; i < 4u; ++i) {
    mask += weights[i] * around[i].mask;
    low = min(low, around[i].low);
    high = max(high, around[i].high);
  }
  const float range = high - low, share = share_of(mask, low, range);
  vec4 most = vec4(0.0), least = vec4(0.0);
  for (uint i = 0u; i < 4u; ++i) {
    const float off_most = range > 0.0 ? (high - around[i].high) / range : 0.0;
    most += weights[i] * likeness(off_most) * vec4(around[i].most, 1.0);
    const float off_least = range > 0.0 ? (around[i].low - low) / range : 0.0;
    const float off = (around[i].brightness - brightness) / ENLARGE_BRIGHTNESS;
    least += weights[i] * likeness(off_least) / (1.0 + off * off) * vec4(around[i].least, 1.0);
  }
  return share * ((1.0 - high) * plate + most.rgb / most.w) +
         (1.0 - share) * ((1.0 - low) * plate + least.rgb / least.w);
}

uvec3 codes_of(uint pixel) {
  const uvec3 codes = plate_codes(pixel);
  const uvec2 at = uvec2(pixel % enlarge.width, pixel / enlarge.width);
  const uvec2 size = uvec2(enlarge.from_width, enlarge.from_height);
  const vec2 place = clamp((vec2(at) + 0.5) * enlarge.step - 0.5, vec2(0.0), vec2(size - 1u));
  const uvec2 first = min(uvec2(place), size - 1u), last = min(first + 1u, size - 1u);
  const uvec4 bits[4] = {sides[first.y * size.x + first.x], sides[first.y * size.x + last.x],
                         sides[last.y * size.x + first.x], sides[last.y * size.x + last.x]};
  const uvec4 any_bits = bits[0] | bits[1] | bits[2] | bits[3];
  // Neither light nor a mask: the byte that says the brightness adds nothing.
  if ((any_bits.x | any_bits.y | any_bits.z | (any_bits.w & 0xffffffu)) == 0u) return codes;
  const vec2 f = place - vec2(first);
  const vec4 weights = vec4(1.0 - f.x, f.x, 1.0 - f.x, f.x) * vec4(vec2(1.0 - f.y), vec2(f.y));
  const Addition around[4] = {addition_of(bits[0]), addition_of(bits[1]), addition_of(bits[2]),
                              addition_of(bits[3])};
  const vec3 plate = vec3(signal_of[codes.r], signal_of[codes.g], signal_of[codes.b]);
  const float brightness = float(codes.r + codes.g + codes.b) / (3.0 * float(enlarge.most));
  return shown_codes_of(signal_over(plate, brightness, around, weights), enlarge.most, at,
                        enlarge.is_dithered != 0u);
}

void main() {
  const uint first = 2u * gl_GlobalInvocationID.x;
  if (first >= enlarge.count) return;
  const uvec3 a = codes_of(enlarge.first + first);
  const uvec3 b = first + 1u < enlarge.count ? codes_of(enlarge.first + first + 1u) : uvec3(0u);
  const uint word = 3u * gl_GlobalInvocationID.x;
  picture[word] = a.r | a.g << 16u;
  picture[word + 1u] = a.b | b.r << 16u;
  picture[word + 2u] = b.g | b.b << 16u;
}
