// What photons bring to a vertex: density estimation over a disc (Jensen 1996), whose radius shrinks
// from pass to pass so that the mean over passes converges (Knaus and Zwicker 2011).
#ifndef PREVIZ_GATHER_GLSL
#define PREVIZ_GATHER_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/photon_grid.glsl"

// The photons of one pass, in a hash grid of cells twice as wide as the radius. These are views of
// sorted_photons and buckets, because texel buffers are read faster on lavapipe.
//
// RGBA32F, TEXELS_PER_PHOTON texels a photon, those of a bucket together: position, Dirac vertices;
// direction, gain in the mixed world; normal, gain in the real world; flux.
uniform textureBuffer found_photons;
uniform utextureBuffer found_buckets;  // RG32UI: first photon, number of photons

// Photons of a surface that bends away by more than 60 degrees, or that lies above or beneath this
// one, are another surface's.
const float SAME_SURFACE_COS = 0.5;
const float SAME_SURFACE_HEIGHT = 0.25;  // over the radius

struct GatheredPair {
  vec3 mixed;
  vec3 real;
};

// f / cos times the flux of one photon, weighed by its distance. Texel 0 is `position`.
void gather_photon(uint photon, vec4 position, Surface s, Lobes l, uint most_vertices,
                   bool differing, inout GatheredPair sum) {
  const vec3 off = position.xyz - s.position;
  const float closeness = 1.0 - dot(off, off) / (batch.photon_radius * batch.photon_radius);
  if (closeness <= 0.0 || uint(position.w) > most_vertices) return;
  if (abs(dot(off, s.geometric_normal)) > SAME_SURFACE_HEIGHT * batch.photon_radius) return;
  const int first = int(photon * TEXELS_PER_PHOTON);
  const vec4 normal = texelFetch(found_photons, first + 2);
  // Which side it came from is the BSDF's concern: rough glass takes both.
  if (abs(dot(normal.xyz, s.geometric_normal)) < SAME_SURFACE_COS) return;
  const vec4 direction = texelFetch(found_photons, first + 1);
  if (differing && direction.w == normal.w) return;
  const float cos_geometric = -dot(direction.xyz, normal.xyz);
  float pdf;
  const vec3 value = bsdf_evaluate(s, l, -direction.xyz, pdf);
  if (pdf <= 0.0 || cos_geometric <= 0.0) return;
  const vec3 flux = texelFetch(found_photons, first + 3).rgb;
  const vec3 radiance = value * flux * (closeness / cos_geometric);
  sum.mixed += radiance * direction.w;
  sum.real += radiance * normal.w;
}

// Whether the disc of photons can reach into a cell: its plane's distance from the cell's centre
// against the half diagonal along the normal.
bool reaches_cell(Surface s, ivec3 cell) {
  const float half_width = batch.photon_radius;
  const vec3 center = (vec3(cell) + 0.5) * (2.0 * half_width);
  const vec3 n = s.geometric_normal;
  const float reach = abs(n.x) + abs(n.y) + abs(n.z) + SAME_SURFACE_HEIGHT + 1e-3;
  return abs(dot(center - s.position, n)) <= reach * half_width;
}

ivec3 neighbour_cell(ivec3 first, uint corner) {
  return first + ivec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
}

// Radiance of both worlds towards the viewer, by the lobes that are not Dirac. Photons that met more
// than `most_vertices` Dirac vertices are left out: their paths would be longer than allowed. So are,
// if only `differing` ones are wanted, those that are the same in both worlds.
GatheredPair gather_photons(Surface s, Lobes l, uint most_vertices, bool differing) {
  GatheredPair sum = GatheredPair(vec3(0.0), vec3(0.0));
  const ivec3 first_cell = photon_cell(s.position - batch.photon_radius);
  // First which of the eight, then only those: lavapipe pays for what a round leaves out.
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
        // Other cells share the bucket; two of the eight may, too.
        if (photon_cell(position.xyz) != cell) continue;
        gather_photon(i, position, s, l, most_vertices, differing, sum);
      }
    }
  }
  // Epanechnikov's kernel on a disc: 2 / (pi r^2) (1 - d^2 / r^2).
  const float scale = 2.0 / (PI * batch.photon_radius * batch.photon_radius * float(frame.photon_count));
  sum.mixed *= scale;
  sum.real *= scale;
  return sum;
}

#endif
