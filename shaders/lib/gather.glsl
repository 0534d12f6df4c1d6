// The light that photons bring to a vertex, by density estimation over a disc (Jensen 1996). Its
// radius shrinks from pass to pass so that the mean over the passes converges (Knaus and Zwicker
// 2011).
#ifndef PREVIZ_GATHER_GLSL
#define PREVIZ_GATHER_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/photon_grid.glsl"

// The photons of one pass, in a hash grid of cells twice as wide as the radius. These are views of
// sorted_photons and buckets, because texel buffers are read faster on lavapipe.
//
// RGBA32F, TEXELS_PER_PHOTON texels a photon, those of a bucket together: position, Dirac vertices;
// direction; normal; flux in the real world. The fluxes of red, green and blue in the mixed world
// are the fourth components of the second and third texel and the first one of the fourth.
uniform textureBuffer found_photons;
uniform utextureBuffer found_buckets;  // RG32UI: first photon, number of photons

// A photon belongs to another surface if the normal of its surface is more than 60 degrees off, or
// if it lies further above or below this one than SAME_SURFACE_HEIGHT.
const float SAME_SURFACE_COS = 0.5;
const float SAME_SURFACE_HEIGHT = 0.25;  // in radii

struct GatheredPair {
  vec3 mixed;
  vec3 real;
};

// Adds f times the flux of one photon, weighted by its distance, without the kernel's constant.
// bsdf_evaluate() returns f * cos, hence the division. `position` is texel 0 of the photon.
void gather_photon(uint photon, vec4 position, Surface s, Lobes l, uint most_vertices,
                   bool differing, inout GatheredPair sum) {
  const vec3 off = position.xyz - s.position;
  const float closeness = 1.0 - dot(off, off) / (batch.photon_radius * batch.photon_radius);
  if (closeness <= 0.0 || uint(position.w) > most_vertices) return;
  if (abs(dot(off, s.geometric_normal)) > SAME_SURFACE_HEIGHT * batch.photon_radius) return;
  const int first = int(photon * TEXELS_PER_PHOTON);
  const vec4 normal = texelFetch(found_photons, first + 2);
  // The side from which the photon came is left to the BSDF: rough glass accepts both.
  if (abs(dot(normal.xyz, s.geometric_normal)) < SAME_SURFACE_COS) return;
  const vec4 direction = texelFetch(found_photons, first + 1);
  const vec4 fluxes = texelFetch(found_photons, first + 3);
  const vec3 mixed = vec3(direction.w, normal.w, fluxes.x);
  const vec3 real = fluxes.yzw;
  if (differing && mixed == real) return;
  const float cos_geometric = -dot(direction.xyz, normal.xyz);
  float pdf;
  const vec3 value = bsdf_evaluate(s, l, -direction.xyz, pdf);
  if (pdf <= 0.0 || cos_geometric <= 0.0) return;
  sum.mixed += value * mixed * (closeness / cos_geometric);
  sum.real += value * real * (closeness / cos_geometric);
}

// Returns whether the disc can reach into a cell, by comparing the distance of the disc's plane
// from the cell's centre with half the cell's extent along the normal.
bool reaches_cell(Surface s, ivec3 cell) {
  const float half_width = batch.photon_radius;
  const vec3 center = (vec3(cell) + 0.5) * (2.0 * half_width);
  const vec3 n = s.geometric_normal;
  const float reach = abs(n.x) + abs(n.y) + abs(n.z) + SAME_SURFACE_HEIGHT + 1e-3;
  return abs(dot(center - s.position, n)) <= reach * half_width;
}

// Returns one of the eight cells whose lowest is `first`.
ivec3 neighbour_cell(ivec3 first, uint corner) {
  return first + ivec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
}

// Returns the radiance of both worlds towards the viewer that photons bring by way of the lobes
// that are not Dirac deltas. Photons that met more than `most_vertices` Dirac vertices are left
// out, because their paths would be longer than allowed. With `differing`, so are those that are
// equal in both worlds.
GatheredPair gather_photons(Surface s, Lobes l, uint most_vertices, bool differing) {
  GatheredPair sum = GatheredPair(vec3(0.0), vec3(0.0));
  const ivec3 first_cell = photon_cell(s.position - batch.photon_radius);
  // First the cells are selected, then only those are searched: on lavapipe, lanes that skip a
  // round of a loop cost as much as those that do not.
  uint reached = 0u;
  for (uint corner = 0u; corner < 8u; ++corner)
    if (reaches_cell(s, neighbour_cell(first_cell, corner))) reached |= 1u << corner;
  for (; reached != 0u; reached &= reached - 1u) {
    const ivec3 cell = neighbour_cell(first_cell, uint(findLSB(reached)));
    const uvec2 bucket = texelFetch(found_buckets, int(photon_bucket(cell))).xy;
    const uint end = bucket.x + bucket.y;
    for (uint chunk = bucket.x; chunk < end; chunk += LOOP_CHUNK) {
      for (uint i = chunk; i < min(chunk + LOOP_CHUNK, end); ++i) {
        const vec4 position = texelFetch(found_photons, int(i * TEXELS_PER_PHOTON));
        // Other cells, even two of these eight, may share the bucket.
        if (photon_cell(position.xyz) != cell) continue;
        gather_photon(i, position, s, l, most_vertices, differing, sum);
      }
    }
  }
  // The kernel is Epanechnikov's on a disc, 2 / (pi r^2) (1 - d^2 / r^2).
  const float scale = 2.0 / (PI * batch.photon_radius * batch.photon_radius * float(frame.photon_count));
  sum.mixed *= scale;
  sum.real *= scale;
  return sum;
}

#endif
