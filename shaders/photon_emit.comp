// Emits the photons of one pass. Photon i is path 2 i; path 2 i + 1 is for the world that may part.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/append.glsl"
#include "shaders/lib/photon.glsl"
#include "shaders/lib/photon_emission.glsl"

// Makes a photon's first ray. Returns whether there is light on it.
bool emit(uint photon) {
  const uint path = 2u * photon;
  const Emission e = emit_photon(photon_sampler(photon));
  const uint worlds = (any(greaterThan(e.gain.mixed, vec3(0.0))) ? WORLD_MIXED : 0u) |
                      (any(greaterThan(e.gain.real, vec3(0.0))) ? WORLD_REAL : 0u);
  for (uint half_path = path; half_path < path + 2u; ++half_path) {
    photons[half_path].mixed = e.gain.mixed;
    photons[half_path].real = e.gain.real;
  }
  ray_origin[path] = vec4(e.origin, 0.0);
  ray_direction[path] = vec4(e.direction, 1.0);
  write_throughput(path, e.flux, worlds);
  return worlds != 0u && any(greaterThan(e.flux, vec3(0.0)));
}

void main() {
  const uint photon = gl_GlobalInvocationID.x;
  bool leaves = false;
  if (photon < frame.photon_count) {
    photon_keys[2u * photon] = NO_INDEX;
    photon_keys[2u * photon + 1u] = NO_INDEX;
    // There may be nothing to aim at: another variant of the set has the mirror.
    if (frame.specular_bound_count > 0u) leaves = emit(photon);
  }
  append_next(leaves, 2u * photon);
}
