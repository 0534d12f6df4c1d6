// Finds the pixels of the plate that show a single surface: no depth edge lies within a pixel of
// them, nor within a circle of confusion, that of the pixel or that of the surface beyond the edge.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/scene.glsl"

// The fourth component says on the way in whether the pixel may be used, and on the way out how far
// its surface is (seen_radiance of camera.glsl).
layout(scalar) buffer PlateBuffer { vec4 plate[]; };
layout(scalar) readonly buffer SeenBuffer { GpuSeen seen[]; };

// A pixel that is blurred by a larger radius than this, in pixels, is not used.
const int MOST_BLUR = 6;
// The inverse depth of a plane is linear over the picture. On a smooth surface it departs from
// linear between two neighbours by no more than this share.
const float FLATNESS = 1e-2;

// Returns the radius of the circle of confusion, in pixels.
float blur_of(float inverse_depth) {
  if (!has_feature(FEATURE_LENS)) return 0.0;
  return frame.lens_radius * abs(inverse_depth - 1.0 / frame.focus_distance) * frame.focal_px.x;
}

// Returns whether the pixels on both sides show the same smooth surface. Pixels further away than
// the blur reaches do not matter.
bool is_smooth(ivec2 pixel, GpuSeen middle, ivec2 off) {
  const ivec2 size = ivec2(frame.width, frame.height);
  const ivec2 before = pixel - off;
  const ivec2 behind = pixel + off;
  if (any(lessThan(min(before, behind), ivec2(0))) ||
      any(greaterThanEqual(max(before, behind), size)))
    return false;
  const GpuSeen a = seen[before.y * size.x + before.x];
  const GpuSeen b = seen[behind.y * size.x + behind.x];
  const float blur = max(blur_of(middle.inverse_depth), max(blur_of(a.inverse_depth),
                                                           blur_of(b.inverse_depth)));
  if (float(max(abs(off.x), abs(off.y))) > blur + 1.0) return true;
  const float bend = a.inverse_depth + b.inverse_depth - 2.0 * middle.inverse_depth;
  return a.instance == middle.instance && b.instance == middle.instance &&
         abs(bend) <= FLATNESS * middle.inverse_depth;
}

bool is_usable(ivec2 pixel, GpuSeen middle) {
  if (middle.inverse_depth <= 0.0 || blur_of(middle.inverse_depth) > float(MOST_BLUR)) return false;
  const int reach = has_feature(FEATURE_LENS) ? MOST_BLUR + 1 : 1;
  for (int y = 0; y <= reach; ++y)
    for (int x = y == 0 ? 1 : -reach; x <= reach; ++x)
      if (!is_smooth(pixel, middle, ivec2(x, y))) return false;
  return true;
}

void main() {
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  if (plate[index].w == 0.0) return;
  const ivec2 pixel = ivec2(index % frame.width, index / frame.width);
  plate[index].w = is_usable(pixel, seen[index]) ? seen[index].inverse_depth : 0.0;
}
