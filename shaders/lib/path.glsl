// Paths in flight: their buffers, the numbering of samples and paths, and the compacted
// queues.
#ifndef PREVIZ_PATH_GLSL
#define PREVIZ_PATH_GLSL

#include "shaders/lib/batch.glsl"
#include "shaders/lib/halves.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"

// A slot is one sample of one pixel. It has two paths, because a path can fork once: path 2 slot, and
// path 2 slot + 1 for the world that parted. With FEATURE_CAMERA a path that landed can fork once
// more: path 2 slots + slot.
PREVIZ_STATE(vec4, ray_origin)        // of a path: origin, t_min
PREVIZ_STATE(vec4, ray_direction)     // of a path: unit direction, pdf (0: no MIS)
PREVIZ_STATE(uvec4, path_throughput)  // of a path: a GpuThroughput
PREVIZ_STATE(uint, path_receiver)     // of a path: see lib/light_tree.glsl
PREVIZ_STATE(uvec2, hits)             // HIT_TEXELS a path: a GpuHit
PREVIZ_STATE(uint, queue)             // [2][paths]: paths to extend, ping-pong
PREVIZ_STATE(uvec2, shadow_rays)      // SHADOW_RAY_TEXELS each, as many as there are paths: a GpuShadowRay
layout(scalar) buffer Mixed { vec4 sample_mixed[]; };           // of a slot: Lm, M
layout(scalar) buffer Real { vec4 sample_real[]; };             // of a slot: Lr, one of SAMPLE_*
layout(scalar) buffer Landed { vec4 sample_landed[]; };         // of a slot: the real part of PATH_LANDED
layout(scalar) buffer Aov { vec4 sample_aov[]; };               // of a slot: normal, depth (0: no hit)
// The denoiser's albedo of a slot (shaders/README.md, "Denoising"): how bright the mixed world's first
// surface is in white light, and what it emits over the sensor's white (lib/halves.glsl). 0: no hit.
// It is kept with FEATURE_TEXTURES and FEATURE_VERTEX_COLORS.
layout(scalar) buffer Albedo { uvec2 sample_albedo[]; };
// The part of Lm and of Lr, two of a slot, that photons have brought to surfaces which the camera sees
// directly or by way of mirrors and glass, and its variance as a mean over the channels. It is kept with
// FEATURE_PHOTONS.
layout(scalar) buffer Caustic { vec4 sample_caustic[]; };
layout(scalar) buffer Control { GpuControl control; };
layout(scalar) readonly buffer Limits { uint limits[]; };       // of the parts of a block of the picture,
                                                                // row-major: how many samples their
                                                                // pixels get
layout(scalar) buffer Pixels { GpuPixel pixels[]; };            // of the tile, row-major
layout(scalar) buffer Caustics { vec4 pixel_caustics[]; };      // of the tile: the sums of what photons
                                                                // bring to the change, and of its variance

// A slot is one sample of one pixel. A tile's slots run through its pixels in blocks of 8x4, so
// that the rays of a subgroup are coherent, and then through its samples. Blocks at the edge are
// padded.
const uvec2 BLOCK = uvec2(8u, 4u);

// Returns the number of slots of one sample of the tile.
uint tile_slots() {
  const uvec2 blocks = (uvec2(batch.width, batch.height) + BLOCK - 1u) / BLOCK;
  return blocks.x * blocks.y * BLOCK.x * BLOCK.y;
}

// Returns the pixel of a slot within its tile; padding of the last blocks lies outside the tile.
uvec2 slot_pixel(uint slot) {
  const uint in_tile = slot % tile_slots();
  const uint block = in_tile / (BLOCK.x * BLOCK.y);
  const uint in_block = in_tile % (BLOCK.x * BLOCK.y);
  const uint blocks_x = (batch.width + BLOCK.x - 1u) / BLOCK.x;
  return uvec2(block % blocks_x, block / blocks_x) * BLOCK +
         uvec2(in_block % BLOCK.x, in_block / BLOCK.x);
}

// Returns the slot of a pixel's first sample; it is the inverse of slot_pixel().
uint pixel_slot(uvec2 pixel) {
  const uint blocks_x = (batch.width + BLOCK.x - 1u) / BLOCK.x;
  const uvec2 block = pixel / BLOCK;
  const uvec2 in_block = pixel % BLOCK;
  return (block.y * blocks_x + block.x) * BLOCK.x * BLOCK.y + in_block.y * BLOCK.x + in_block.x;
}

// Returns the largest number of samples that a pixel of the picture may get.
uint sample_limit(uvec2 pixel) {
  const uint blocks_x = (frame.width + SAMPLED_BLOCK - 1u) / SAMPLED_BLOCK;
  const uint block = pixel.y / SAMPLED_BLOCK * blocks_x + pixel.x / SAMPLED_BLOCK;
  return limits[SAMPLED_PARTS * block + (pixel.y & 1u) * 2u + (pixel.x & 1u)];
}

uint slot_sample(uint slot) { return batch.first_sample + slot / tile_slots(); }

// Returns the random numbers of a slot, whose pixel is this one of the picture.
Sampler slot_sampler(uint slot, uvec2 pixel) {
  const Sampler random = make_sampler(frame.seed, pixel, frame.past_samples + slot_sample(slot));
  return frame.has_separate_parts != 0u ? separate_parts(random) : random;
}

GpuThroughput read_throughput(uint path) {
  const uvec4 words = read_path_throughput(path);
  return GpuThroughput(uintBitsToFloat(words.xyz), words.w);
}
void write_throughput(uint path, vec3 factor, uint state) {
  path_throughput[path] = uvec4(floatBitsToUint(factor), state);
}

GpuHit read_hit(uint path) {
  const uint first = path * HIT_TEXELS;
  const uvec2 triangle = read_hits(first);
  return GpuHit(uintBitsToFloat(read_hits(first + 2u).x), uintBitsToFloat(read_hits(first + 1u)), triangle.x,
                triangle.y);
}
void write_hit(uint path, GpuHit hit) {
  const uint first = path * HIT_TEXELS;
  hits[first] = uvec2(hit.instance, hit.primitive);
  hits[first + 1u] = floatBitsToUint(hit.barycentrics);
  hits[first + 2u].x = floatBitsToUint(hit.t);
}

GpuShadowRay read_shadow_ray(uint index) {
  uvec2 t[SHADOW_RAY_TEXELS];
  vec2 f[SHADOW_RAY_TEXELS];
  for (uint i = 0u; i < SHADOW_RAY_TEXELS; ++i) {
    t[i] = read_shadow_rays(index * SHADOW_RAY_TEXELS + i);
    f[i] = uintBitsToFloat(t[i]);
  }
  return GpuShadowRay(vec3(f[0], f[1].x), f[1].y, vec3(f[2], f[3].x), t[3].y, vec3(f[4], f[5].x),
                      vec3(f[5].y, f[6]));
}
void write_shadow_ray(uint index, GpuShadowRay ray) {
  const uint first = index * SHADOW_RAY_TEXELS;
  shadow_rays[first] = floatBitsToUint(ray.origin.xy);
  shadow_rays[first + 1u] = floatBitsToUint(vec2(ray.origin.z, ray.t_max));
  shadow_rays[first + 2u] = floatBitsToUint(ray.direction.xy);
  shadow_rays[first + 3u] = uvec2(floatBitsToUint(ray.direction.z), ray.path_and_worlds);
  shadow_rays[first + 4u] = floatBitsToUint(ray.mixed.xy);
  shadow_rays[first + 5u] = floatBitsToUint(vec2(ray.mixed.z, ray.real.x));
  shadow_rays[first + 6u] = floatBitsToUint(ray.real.yz);
}

// The queue buffer has two halves: the active one is being worked on, the next one is being filled.
uint active_queue_index(uint i) { return control.queue_side * (queue.length() / 2u) + i; }
uint next_queue_index(uint i) { return (1u - control.queue_side) * (queue.length() / 2u) + i; }

uint path_worlds(uint bits) { return bits & PATH_WORLDS_MASK; }
uint path_depth(uint bits) { return (bits >> PATH_DEPTH_SHIFT) & 0xffu; }
uint path_passes(uint bits) {
  return has_feature(FEATURE_PANES) ? (bits >> PATH_PASSES_SHIFT) & 0xfu : 0u;
}
bool path_is_behind(uint bits) {
  return has_feature(FEATURE_PANES) && (bits & PATH_BEHIND) != 0u;
}

// Returns the number of slots for whose paths there is room.
uint slot_count() {
  return uint(ray_origin.length()) / (has_feature(FEATURE_CAMERA) ? 3u : 2u);
}
uint path_slot(uint path) {
  return has_feature(FEATURE_CAMERA) && path >= 2u * slot_count() ? path - 2u * slot_count()
                                                                  : path >> 1;
}

// After a fork, a ray resumes just before the hit at which the worlds parted. It cannot meet that
// surface again, since the surface is not in its world.
const float RESUME_BEFORE = 0.9999;

// Returns the t_min of a ray that forks at a hit. A ray that has passed a pane just before the hit
// goes on behind the pane, which it would pass twice otherwise.
float forked_t_min(float t_min, float t_hit, inout bool is_behind) {
  is_behind = is_behind && t_min > t_hit * RESUME_BEFORE;
  return is_behind ? t_min : t_hit;
}

// The factors by which light is scaled in each world.
struct Gain {
  vec3 mixed;
  vec3 real;
};
// The gain of what shines in both worlds alike.
const Gain EQUAL_GAIN = Gain(vec3(1.0), vec3(1.0));

// Adds light to the radiance of the worlds that a path is in. Of a slot's paths only one is in each
// world, and the real part of a landed path has a sum of its own, so no two invocations write the
// same value.
void add_pair(uint slot, uint worlds, bool landed, vec3 mixed, vec3 real) {
  if ((worlds & WORLD_MIXED) != 0u) sample_mixed[slot].rgb += mixed;
  if ((worlds & WORLD_REAL) == 0u) return;
  if (has_feature(FEATURE_CAMERA) && landed)
    sample_landed[slot].rgb += real;
  else
    sample_real[slot].rgb += real;
}

#endif
