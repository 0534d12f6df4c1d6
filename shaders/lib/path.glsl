// Paths in flight: set 1's buffers, the batch, and compacted queues.
#ifndef PREVIZ_PATH_GLSL
#define PREVIZ_PATH_GLSL

#include "shaders/lib/batch.glsl"
#include "shaders/lib/scene.glsl"

layout(scalar, set = 1, binding = BINDING_RAY_ORIGIN) buffer RayOrigin { vec4 ray_origin[]; };
layout(scalar, set = 1, binding = BINDING_RAY_DIRECTION) buffer RayDirection { vec4 ray_direction[]; };
layout(scalar, set = 1, binding = BINDING_THROUGHPUT) buffer Throughput { vec4 path_throughput[]; };
layout(scalar, set = 1, binding = BINDING_HIT) buffer Hits { GpuHit hits[]; };
layout(scalar, set = 1, binding = BINDING_QUEUE) buffer Queue { uint queue[]; };
layout(scalar, set = 1, binding = BINDING_SHADOW) buffer Shadow { GpuShadowRay shadow_rays[]; };
layout(scalar, set = 1, binding = BINDING_SAMPLE_MIXED) buffer Mixed { vec4 sample_mixed[]; };
layout(scalar, set = 1, binding = BINDING_SAMPLE_REAL) buffer Real { vec4 sample_real[]; };
layout(scalar, set = 1, binding = BINDING_SAMPLE_AOV) buffer Aov { vec4 sample_aov[]; };
layout(scalar, set = 1, binding = BINDING_CONTROL) buffer Control { GpuControl control; };
layout(scalar, set = 1, binding = BINDING_SAMPLED) readonly buffer Sampled { uint sampled[]; };
layout(scalar, set = 1, binding = BINDING_PIXELS) buffer Pixels { GpuPixel pixels[]; };

// Slots of a tile: pixels in blocks of 8x4 for coherent rays, rounded up; then sample by sample.
const uvec2 BLOCK = uvec2(8u, 4u);

uint tile_slots() {
  const uvec2 blocks = (uvec2(batch.width, batch.height) + BLOCK - 1u) / BLOCK;
  return blocks.x * blocks.y * BLOCK.x * BLOCK.y;
}

// The pixel of a slot within its tile; outside the tile for the padding of the last blocks.
uvec2 slot_pixel(uint slot) {
  const uint in_tile = slot % tile_slots();
  const uint block = in_tile / (BLOCK.x * BLOCK.y);
  const uint in_block = in_tile % (BLOCK.x * BLOCK.y);
  const uint blocks_x = (batch.width + BLOCK.x - 1u) / BLOCK.x;
  return uvec2(block % blocks_x, block / blocks_x) * BLOCK +
         uvec2(in_block % BLOCK.x, in_block / BLOCK.x);
}

uint pixel_slot(uvec2 pixel) {
  const uint blocks_x = (batch.width + BLOCK.x - 1u) / BLOCK.x;
  const uvec2 block = pixel / BLOCK;
  const uvec2 in_block = pixel % BLOCK;
  return (block.y * blocks_x + block.x) * BLOCK.x * BLOCK.y + in_block.y * BLOCK.x + in_block.x;
}

uint slot_sample(uint slot) { return batch.first_sample + slot / tile_slots(); }

// Half of the queue buffer that is being worked on, and the half that is being filled.
uint active_queue_index(uint i) { return control.queue_side * (queue.length() / 2u) + i; }
uint next_queue_index(uint i) { return (1u - control.queue_side) * (queue.length() / 2u) + i; }

uint path_worlds(uint bits) { return bits & PATH_WORLDS_MASK; }
uint path_depth(uint bits) { return (bits >> PATH_DEPTH_SHIFT) & 0xffu; }

// Adds light to what the worlds of a path have received. Only one path of a slot is in each world,
// so no two invocations write the same value.
void add_radiance(uint slot, uint worlds, vec3 radiance, vec2 gain) {
  if ((worlds & WORLD_MIXED) != 0u) sample_mixed[slot].rgb += radiance * gain.x;
  if ((worlds & WORLD_REAL) != 0u) sample_real[slot].rgb += radiance * gain.y;
}

#endif
