// The light that photons bring to a vertex, by density estimation over a disc (Jensen 1996). Its
// radius is that of a number of pixels at the vertex's distance from the camera, and shrinks from pass to pass so that the mean over the passes converges (Knaus and Zwicker
// 2011).
#ifndef PREVIZ_GATHER_GLSL
#define PREVIZ_GATHER_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/photon_grid.glsl"

// The photons of one pass, in a hash grid (lib/photon_grid.glsl): views of sorted_photons and buckets.
//
// TEXELS_PER_PHOTON a photon, those of a bucket together: position, Dirac vertices;
// direction; normal; flux in the real world. The fluxes of red, green and blue in the mixed world
// are the fourth components of the second and third texel and the first one of the fourth.
PREVIZ_FETCHED(vec4, found_photons)
PREVIZ_FETCHED(uvec2, found_buckets)  // first photon, number of photons

// A photon belongs to another surface if the normal of its surface is more than 60 degrees off, or
// if it lies further above or below this one than SAME_SURFACE_HEIGHT.
const float SAME_SURFACE_COS = 0.5;
const float SAME_SURFACE_HEIGHT = 0.25;  // in radii

struct GatheredPair {
  vec3 mixed;
  vec3 real;
  // Sums of the squares of what single photons bring, as means over the channels. As photons come
  // independently of one another, that is the variance of the sums (Campbell's theorem).
  float mixed_variance;
  float real_variance;
};

// A variance is limited to this, so that the light of a vanishing disc overflows nothing.
const float MOST_VARIANCE = 1e30;

float mean_square(vec3 v) { return min(dot(v, v) / 3.0, MOST_VARIANCE); }
float scaled_variance(float variance, float scale) {
  return min(variance * scale * scale, MOST_VARIANCE);
}

// Adds f times the flux of one photon, weighted by its closeness, 1 - d^2 / r^2, without the kernel's
// constant. bsdf_evaluate() returns f * cos, hence the division.
void gather_photon(uint photon, float closeness, Surface s, Lobes l, bool differing,
                   inout GatheredPair sum) {
  const int first = int(photon * TEXELS_PER_PHOTON);
  const vec4 normal = fetch(found_photons, first + 2);
  // The side from which the photon came is left to the BSDF: rough glass accepts both.
  if (abs(dot(normal.xyz, s.geometric_normal)) < SAME_SURFACE_COS) return;
  const vec4 direction = fetch(found_photons, first + 1);
  const vec4 fluxes = fetch(found_photons, first + 3);
  const vec3 mixed = vec3(direction.w, normal.w, fluxes.x);
  const vec3 real = fluxes.yzw;
  if (differing && mixed == real) return;
  const float cos_geometric = -dot(direction.xyz, normal.xyz);
  float pdf;
  const vec3 value = bsdf_evaluate(s, l, -direction.xyz, pdf);
  if (pdf <= 0.0 || cos_geometric <= 0.0) return;
  const vec3 weight = value * (closeness / cos_geometric);
  sum.mixed += weight * mixed;
  sum.real += weight * real;
  sum.mixed_variance += mean_square(weight * mixed);
  sum.real_variance += mean_square(weight * real);
}

// Returns whether the disc can reach into a cell, by comparing the distance of the disc's plane
// from the cell's centre with half the cell's extent along the normal.
bool reaches_cell(Surface s, float radius, ivec3 cell, float width) {
  const vec3 center = (vec3(cell) + 0.5) * width;
  const vec3 n = s.geometric_normal;
  const float reach = (0.5 * (abs(n.x) + abs(n.y) + abs(n.z)) + 1e-3) * width;
  return abs(dot(center - s.position, n)) <= reach + SAME_SURFACE_HEIGHT * radius;
}

// Returns one of the eight cells whose lowest is `first`.
ivec3 neighbour_cell(ivec3 first, uint corner) {
  return first + ivec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
}

// Adds the photons of one of the eight cells whose lowest is `first` that lie on the disc and met no
// more than `most_vertices` Dirac vertices.
void gather_cell(ivec3 first, uint corner, int level, float radius, Surface s, Lobes l, uint most_vertices,
                 bool differing, inout GatheredPair sum) {
  const uvec2 bucket =
      fetch(found_buckets, int(photon_bucket(neighbour_cell(first, corner), level)));
  const uint end = bucket.x + bucket.y;
  for (uint chunk = bucket.x; chunk < end; chunk += LOOP_CHUNK) {
    for (uint i = chunk; i < min(chunk + LOOP_CHUNK, end); ++i) {
      const vec4 photon = fetch(found_photons, int(i * TEXELS_PER_PHOTON));
      const vec3 off = photon.xyz - s.position;
      const float closeness = 1.0 - dot(off, off) / (radius * radius);
      if (closeness <= 0.0 || uint(photon.w) > most_vertices) continue;
      if (abs(dot(off, s.geometric_normal)) > SAME_SURFACE_HEIGHT * radius) continue;
      // Other cells, even two of those that are searched, may share the bucket.
      if (photon_level(photon.xyz) != level || photon_cell(photon.xyz, level) != neighbour_cell(first, corner))
        continue;
      gather_photon(i, closeness, s, l, differing, sum);
    }
  }
}

// Returns the radiance of both worlds towards the viewer that photons bring by way of the lobes
// that are not Dirac deltas. Photons that met more than `most_vertices` Dirac vertices are left
// out, because their paths would be longer than allowed. With `differing`, so are those that are
// equal in both worlds.
GatheredPair gather_photons(Surface s, Lobes l, uint most_vertices, bool differing) {
  GatheredPair sum = GatheredPair(vec3(0.0), vec3(0.0), 0.0, 0.0);
  const float radius = photon_radius(s.position);
  // A photon on the disc may be nearer to the camera than its centre, or farther, by the radius.
  const int last_level = photon_level(radius * (1.0 + batch.photon_radius) * 1.0001);
  for (int level = photon_level(radius * (1.0 - batch.photon_radius) * 0.9999);
       level <= last_level; ++level) {
    const float width = cell_width(level);
    const ivec3 first_cell = photon_cell(s.position - radius, level);
    // First the cells are selected, then only those are searched: on lavapipe, lanes that skip a
    // round of a loop cost as much as those that do not.
    uint reached = 0u;
    for (uint corner = 0u; corner < 8u; ++corner)
      if (reaches_cell(s, radius, neighbour_cell(first_cell, corner), width))
        reached |= 1u << corner;
    for (; reached != 0u; reached &= reached - 1u)
      gather_cell(first_cell, uint(findLSB(reached)), level, radius, s, l, most_vertices, differing,
                  sum);
  }
  // The kernel is Epanechnikov's on a disc, 2 / (pi r^2) (1 - d^2 / r^2).
  const float scale = 2.0 / (PI * radius * radius * float(frame.photon_count));
  sum.mixed *= scale;
  sum.real *= scale;
  sum.mixed_variance = scaled_variance(sum.mixed_variance, scale);
  sum.real_variance = scaled_variance(sum.real_variance, scale);
  return sum;
}

#endif
