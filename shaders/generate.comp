// Makes the camera rays: one path per slot, through a point of the pixel and a point of the lens.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/append.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/difference_bounds.glsl"
#include "shaders/lib/plate.glsl"
#include "shaders/lib/sampler.glsl"

// Returns whether an object that is in one world only may cover a part of the pixel. Its bound is
// widened by the extent of the pixel and by the lens, and tested against the ray through the
// pixel's centre.
bool may_be_covered(uvec2 pixel) {
  const vec3 corner = vec3(calibrated_ray(pixel, vec2(0.0)), 1.0);
  const vec3 ray = vec3(calibrated_ray(pixel, vec2(0.5)), 1.0);
  const float pixel_angle = 1.5 * length(corner - ray);  // that of half the diagonal, with a margin
  const vec3 direction = normalize(transform_vector(frame.world_from_camera, ray));
  for (uint i = 0u; i < frame.bound_count; ++i) {
    const vec4 bound = fetch(bounds, int(i));
    const float far = length(bound.xyz) + bound.w;
    float radius = bound.w + pixel_angle * far;
    if (has_feature(FEATURE_LENS)) radius += frame.lens_radius * (1.0 + far / frame.focus_distance);
    const float along = max(dot(bound.xyz, direction), 0.0);
    const vec3 off = bound.xyz - along * direction;
    if (dot(off, off) <= radius * radius) return true;
  }
  return false;
}

// Returns whether the plate says no more of some channel than that it is at least white. The
// composite then needs the model's own radiance, not the difference alone.
bool may_be_clipped(uvec2 pixel) {
  if (frame.clip_from == NO_INDEX) return false;
  const uvec3 codes = plate_codes(pixel.y * frame.width + pixel.x);
  return any(greaterThanEqual(codes, uvec3(frame.clip_from)));
}

void main() {
  const uint slot = gl_GlobalInvocationID.x;
  const uvec2 in_tile = slot_pixel(slot);
  const bool valid = slot < tile_slots() * batch.samples &&
                     all(lessThan(in_tile, uvec2(batch.width, batch.height)));
  const uvec2 pixel = uvec2(batch.x, batch.y) + in_tile;
  const bool wanted = valid && slot_sample(slot) < sample_limit(pixel);
  if (wanted) {
    const Sampler random = slot_sampler(slot, pixel);
    vec3 target = vec3(calibrated_ray(pixel, sample_2d(random, PAIR_PIXEL)), 1.0);
    vec3 origin = vec3(0.0);
    if (has_feature(FEATURE_LENS)) {
      origin.xy = frame.lens_radius * sample_disc(sample_2d(random, PAIR_LENS));
      target = target * frame.focus_distance - origin;
    }
    const uint path = 2u * slot;
    ray_origin[path] = vec4(transform_vector(frame.world_from_camera, origin), 0.0);
    ray_direction[path] = vec4(normalize(transform_vector(frame.world_from_camera, target)), 0.0);
    const bool difference =
        has_feature(FEATURE_DIFFERENCE) && !may_be_covered(pixel) && !may_be_clipped(pixel);
    const uint bits = WORLD_BOTH | (difference ? PATH_DIFFERENCE : 0u);
    write_throughput(path, vec3(1.0), bits);
    sample_mixed[slot] = vec4(0.0);
    sample_real[slot] = vec4(0.0, 0.0, 0.0, difference ? SAMPLE_DIFFERENCE : SAMPLE_FULL);
    if (has_feature(FEATURE_CAMERA)) sample_landed[slot] = vec4(0.0);
    sample_aov[slot] = vec4(0.0);
    if (has_feature(FEATURE_PHOTONS))
      sample_caustic[2u * slot] = sample_caustic[2u * slot + 1u] = vec4(0.0);
    if (has_feature(FEATURE_TEXTURES | FEATURE_VERTEX_COLORS))
      sample_albedo[slot] = uvec2(0u);
  }
  append_next(wanted, 2u * slot);
}
