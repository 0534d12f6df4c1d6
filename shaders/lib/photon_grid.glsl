// The hash grid by which photons are found. Discs grow with their distance from the camera, so that
// all have one size on the picture, and so do the cells: each belongs to a level, which holds the
// photons at distances up to a quarter apart.
#ifndef PREVIZ_PHOTON_GRID_GLSL
#define PREVIZ_PHOTON_GRID_GLSL

#include "shaders/lib/batch.glsl"
#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"

// Lavapipe of Mesa 22.3 silently ends a loop after 65535 rounds, so longer loops run in chunks.
const uint LOOP_CHUNK = 32768u;

// Radii are squared, which must not round to zero.
const float LEAST_PHOTON_RADIUS = 1e-15;

// Returns the radius of the disc over which photons are gathered at a point. The camera is the
// origin.
float photon_radius(vec3 position) {
  return max(batch.photon_radius * length(position), LEAST_PHOTON_RADIUS);
}

// Returns the level of photons around which discs have this radius. Four levels make a factor of two:
// the number is the float's exponent and the two first bits of its mantissa. A cell is as wide as the
// discs that reach a photon of its level, which may be farther than the photon by the radius, so that
// a disc touches at most two cells along each axis.
int photon_level(float radius) {
  return floatBitsToInt(radius * (2.02 / (1.0 - batch.photon_radius))) >> 21;
}
int photon_level(vec3 position) { return photon_level(photon_radius(position)); }

float cell_width(int level) { return intBitsToFloat((level + 1) << 21); }

// Floats beyond the range of an int have no defined int; where the radius has shrunk so far, a disc
// holds no photon.
ivec3 photon_cell(vec3 position, int level) {
  return ivec3(clamp(floor(position / cell_width(level)), vec3(-1e9), vec3(1e9)));
}

// Returns twice the number of photons, rounded up to a power of two; daemon/core/render/passes/photon_map.cpp
// allocates as many buckets.
uint photon_bucket_count() { return 2u << findMSB(2u * frame.photon_count - 1u); }

// Returns the bucket of a cell; several cells may share it.
uint photon_bucket(ivec3 cell, int level) {
  const uvec3 c = uvec3(cell);
  const uint place = hash_pair(c.x, c.y) ^ (c.z * 0x9e3779b9u) ^ (uint(level) * 0x85ebca6bu);
  return hash_bits(place) & (photon_bucket_count() - 1u);
}
uint photon_bucket(vec3 position) {
  const int level = photon_level(position);
  return photon_bucket(photon_cell(position, level), level);
}

#endif
