// The hash grid by which photons are found. A cell is twice as wide as the radius, so that a disc
// touches at most two cells along each axis.
#ifndef PREVIZ_PHOTON_GRID_GLSL
#define PREVIZ_PHOTON_GRID_GLSL

#include "shaders/lib/batch.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"

// Lavapipe of Mesa 22.3 silently ends a loop after 65535 rounds, so longer loops run in chunks.
const uint LOOP_CHUNK = 32768u;

// Floats beyond the range of an int have no defined int; where the radius has shrunk so far, a disc
// holds no photon.
ivec3 photon_cell(vec3 position) {
  return ivec3(clamp(floor(position / (2.0 * batch.photon_radius)), vec3(-1e9), vec3(1e9)));
}

// Returns twice the number of photons, rounded up to a power of two; daemon/render/photon_map.cpp
// allocates as many buckets.
uint photon_bucket_count() { return 2u << findMSB(2u * frame.photon_count - 1u); }

// Returns the bucket of a cell; several cells may share it.
uint photon_bucket(ivec3 cell) {
  const uvec3 c = uvec3(cell);
  return hash_bits(hash_pair(c.x, c.y) ^ (c.z * 0x9e3779b9u)) & (photon_bucket_count() - 1u);
}

#endif
