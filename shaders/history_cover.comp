// Finds which share of each pixel virtual objects cover at their outlines, by rays that are not shaded. One
// sample a frame says all or nothing, and an outline would crawl with that noise (shaders/README.md,
// "Accumulation over time"). The rays of a work group's outlines are spread over all its lanes, because
// few of its pixels are at one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/history.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/trace.glsl"

layout(scalar) readonly buffer Things { uvec2 things[]; };  // history_surface.comp
layout(scalar) writeonly buffer Covers { float covers[]; };

// So many points of a sequence are spread evenly over pixel and lens. They are the same in every
// frame, so that the outlines of a still picture stand still.
const uint RAYS = uint(COVER_RAYS);

shared uint outlines[WORKGROUP_SIZE];  // pixels
shared uint outline_count;
shared uint found[WORKGROUP_SIZE];  // rays that have met a virtual object
const uint SEES_THROUGH = 1u << 16;  // added for each ray that has met what lets light through

float class_at(ivec2 at) {
  if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, ivec2(frame.width, frame.height))))
    return COVER_UNKNOWN;
  return class_of(things[at.y * int(frame.width) + at.x].x);
}

// A pixel that has an outline in it has both sides at the middles of the pixels around, and so has one beside
// it, whose past has the outline that has moved on.
const int REACH = int(HISTORY_REACH);

// Returns COVER_SEE_THROUGH where something beside the pixel lets light through, a share where a virtual object
// ends between the middles of the pixels around, and else COVER_UNKNOWN.
float cover_around(ivec2 at) {
  const float own = class_at(at);
  bool differs = false;
  bool sees_through = false;
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      const float there = class_at(at + ivec2(x, y));
      const bool is_beside = max(abs(x), abs(y)) <= 1;
      sees_through = sees_through || (is_beside && there == COVER_SEE_THROUGH);
      differs = differs || (there >= 0.0 && there != own);
    }
  return sees_through ? COVER_SEE_THROUGH : differs ? own : COVER_UNKNOWN;
}

// Returns what a ray through the pixel adds to `found`.
uint find(uint index, uint ray) {
  const uvec2 pixel = uvec2(index % frame.width, index / frame.width);
  const Sampler random = make_sampler(frame.seed, pixel, ray);
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
    return 0u;
  const uint through = lets_light_through(instance_at(hit.instance).material) ? SEES_THROUGH : 0u;
  return through + uint(hit.presence != WORLD_BOTH);
}

void main() {
  const uint lane = gl_LocalInvocationID.x;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  if (lane == 0u) outline_count = 0u;
  found[lane] = 0u;
  barrier();
  if (gl_GlobalInvocationID.x < batch.width * batch.height) {
    const float cover = cover_around(ivec2(index % frame.width, index / frame.width));
    covers[index] = cover;
    if (cover >= 0.0) outlines[atomicAdd(outline_count, 1u)] = index;
  }
  barrier();
  for (uint i = lane; i < outline_count * RAYS; i += WORKGROUP_SIZE)
    atomicAdd(found[i / RAYS], find(outlines[i / RAYS], i % RAYS));
  barrier();
  if (lane >= outline_count) return;
  covers[outlines[lane]] =
      found[lane] >= SEES_THROUGH ? COVER_SEE_THROUGH : float(found[lane]) / float(RAYS);
}
