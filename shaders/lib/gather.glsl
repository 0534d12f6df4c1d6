// What photons bring to a vertex: density estimation over a disc (Jensen 1996), whose radius shrinks
// from pass to pass so that the mean over passes converges (Knaus and Zwicker 2011).
#ifndef PREVIZ_GATHER_GLSL
#define PREVIZ_GATHER_GLSL

#include "shaders/lib/bsdf.glsl"
#include "shaders/lib/photon.glsl"

// Photons of a surface that bends away by more than 60 degrees, or that lies above or beneath this
// one, are another surface's.
const float SAME_SURFACE_COS = 0.5;
const float SAME_SURFACE_HEIGHT = 0.25;  // over the radius

struct GatheredPair {
  vec3 mixed;
  vec3 real;
};

// f / cos times the density of one photon: its share of the radiance towards the viewer.
void gather_photon(GpuPhoton photon, Surface s, Lobes l, uint most_vertices,
                   inout GatheredPair sum) {
  const vec3 off = photon.position - s.position;
  const float closeness = 1.0 - dot(off, off) / (batch.photon_radius * batch.photon_radius);
  if (closeness <= 0.0 || photon.vertices > most_vertices) return;
  if (abs(dot(off, s.geometric_normal)) > SAME_SURFACE_HEIGHT * batch.photon_radius) return;
  if (dot(photon.normal, s.geometric_normal) < SAME_SURFACE_COS) return;
  const vec3 wi = -photon.direction;
  const float cos_geometric = dot(wi, photon.normal);
  float pdf;
  const vec3 value = bsdf_evaluate(s, l, wi, pdf);
  if (pdf <= 0.0 || cos_geometric <= 0.0) return;
  const vec3 radiance = value * photon.flux * (closeness / cos_geometric);
  sum.mixed += radiance * photon.gain.x;
  sum.real += radiance * photon.gain.y;
}

// Radiance of both worlds towards the viewer, by the lobes that are not Dirac. Photons that met more
// than `most_vertices` Dirac vertices are left out: their paths would be longer than allowed.
GatheredPair gather_photons(Surface s, Lobes l, uint most_vertices) {
  GatheredPair sum = GatheredPair(vec3(0.0), vec3(0.0));
  const ivec3 first_cell = photon_cell(s.position - batch.photon_radius);
  for (uint corner = 0u; corner < 8u; ++corner) {
    const ivec3 cell = first_cell + ivec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
    const GpuPhotonBucket bucket = buckets[photon_bucket(cell)];
    const uint end = bucket.first + bucket.count;
    for (uint chunk = bucket.first; chunk < end; chunk += LOOP_CHUNK) {
      for (uint i = chunk; i < min(chunk + LOOP_CHUNK, end); ++i) {
        const uint photon = photon_order[i];
        // Other cells share the bucket; two of the eight may, too.
        if (photon_cell(photons[photon].position) != cell) continue;
        gather_photon(photons[photon], s, l, most_vertices, sum);
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
