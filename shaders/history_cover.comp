// Finds which share of each pixel virtual objects cover at their outlines, by rays that are not shaded. One
// sample a frame says all or nothing, and an outline would crawl with that noise (shaders/README.md,
// "Accumulation over time").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/trace.glsl"

// The classes are those that history_surface.comp found at the middles of the pixels: 0, 1 or COVER_*.
layout(scalar) readonly buffer Classes { float classes[]; };
layout(scalar) writeonly buffer Covers { float covers[]; };

// So many points of a sequence are spread evenly over pixel and lens. They are the same in every
// frame, so that the outlines of a still picture stand still.
const uint RAYS = 16u;

float class_at(ivec2 at) {
  if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, ivec2(frame.width, frame.height))))
    return COVER_UNKNOWN;
  return classes[at.y * int(frame.width) + at.x];
}

// A pixel that has an outline in it has both sides at the middles of the pixels around, and so has one beside
// it, whose past has the outline that has moved on.
const int REACH = 2;

// Returns whether a virtual object ends between the middles of the pixels around, and nothing there lets
// light through.
bool is_outline(ivec2 at) {
  const float own = class_at(at);
  bool differs = false;
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      const float there = class_at(at + ivec2(x, y));
      if (there == COVER_SEE_THROUGH) return false;
      differs = differs || (there != COVER_UNKNOWN && there != own);
    }
  return differs;
}

// Returns whether what a ray meets first is in one world only. `sees_through` becomes true where that
// lets light through.
bool is_covered(uvec2 pixel, Sampler random, inout bool sees_through) {
  vec3 origin = vec3(0.0);
  vec3 target = vec3(calibrated_ray(pixel, sample_2d(random, PAIR_PIXEL)), 1.0);
  if (has_feature(FEATURE_LENS)) {
    origin.xy = frame.lens_radius * sample_disc(sample_2d(random, PAIR_LENS));
    target = target * frame.focus_distance - origin;
  }
  Hit hit;
  if (!trace_closest(transform_vector(frame.world_from_camera, origin),
                     normalize(transform_vector(frame.world_from_camera, target)), 0.0, 3.4e38,
                     WORLD_BOTH, hit))
    return false;
  const uint material = instances[hit.instance].material;
  sees_through = sees_through || lets_light_through(material);
  return hit.presence != WORLD_BOTH;
}

void main() {
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uvec2 pixel = uvec2(index % frame.width, index / frame.width);
  covers[index] = COVER_UNKNOWN;
  if (!is_outline(ivec2(pixel))) return;
  bool sees_through = false;
  uint covered = 0u;
  for (uint i = 0u; i < RAYS; ++i)
    covered += uint(is_covered(pixel, make_sampler(frame.seed, pixel, i), sees_through));
  if (!sees_through) covers[index] = float(covered) / float(RAYS);
}
