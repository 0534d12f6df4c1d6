// Finds the surface that each pixel shows at its middle, and for how many samples what is seen there
// may be carried along: light that a smooth surface reflects does not move as the surface does
// (shaders/README.md, "Accumulation over time").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/history.glsl"
#include "shaders/lib/moved.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/trace.glsl"

layout(scalar) writeonly buffer Places { vec4 places[]; };  // from the camera; most samples
layout(scalar) writeonly buffer Things { uvec2 things[]; };  // instance, normals (pack_normals)
layout(scalar) writeonly buffer Classes { float classes[]; };  // 1: a virtual object; 0: none; COVER_*

// Plastic and lacquer reflect about this share of the light around.
const float COAT_SHARE = 0.1;
// What is reflected may turn by this share of the lobe's width while it is averaged.
const float MOST_TURN = 0.5;
const float ANY_NUMBER = 1e9;
const float LEAST_LEFT = 0.25;

// Returns for how many samples the reflections of a surface stay what they are, if every frame turns
// them by this angle.
float most_samples(Surface s, float turn) {
  if (!is_specular(s)) return ANY_NUMBER;
  const float coat = COAT_SHARE * s.specular * (1.0 - s.metallic) * (1.0 - s.transmission);
  const float finest = 1.0 / frame.focal_px.x;  // a pixel
  float needed = max(max(s.metallic, s.transmission), coat) / max(s.alpha, finest);
  if (has_feature(FEATURE_CLEARCOAT))
    needed = max(needed, COAT_SHARE * s.clearcoat / max(s.clearcoat_alpha, finest));
  return needed * turn > 0.0 ? MOST_TURN * history.samples / (needed * turn) : ANY_NUMBER;
}

// Returns the angle between the directions, seen from the surface, to the camera now and in the frame
// before.
float turn_of(vec3 position, GpuMotion motion) {
  const vec3 now = normalize(rotated(motion.before_from_now, position));
  const vec3 before = normalize(moved(motion.before_from_now, position));
  return length(now - before);
}

void main() {
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  const uvec2 pixel = uvec2(index % frame.width, index / frame.width);
  classes[index] = 0.0;
  places[index] = vec4(0.0);
  things[index] = uvec2(NO_INDEX, 0u);
  const vec3 ray = normalize(vec3(calibrated_ray(pixel, vec2(0.5)), 1.0));
  const vec3 direction = transform_vector(frame.world_from_camera, ray);
  Hit hit;
  if (!trace_closest(vec3(0.0), direction, 0.0, 3.4e38, WORLD_MIXED, hit)) return;
  // What shines through, through a hole or through a pane, is not at this surface.
  classes[index] = hit.presence == WORLD_BOTH ? 0.0 : 1.0;
  if (lets_light_through(instances[hit.instance].material)) {
    classes[index] = COVER_SEE_THROUGH;
    return;
  }
  const Surface s =
      make_surface(GpuHit(hit.t, hit.barycentrics, hit.instance, hit.primitive), direction, 0.0);
  const GpuMotion motion = motions[hit.instance];
  float most = motion.is_known != 0u ? most_samples(s, turn_of(s.position, motion)) : 0.0;
  const float change = change_by_moved(s, hit.instance);
  // What counts as less than a quarter of a sample after a change would only be seen as a ghost.
  const float left = change > 0.0 ? history.samples * history.most_drift / change : ANY_NUMBER;
  most = left < LEAST_LEFT ? 0.0 : min(most, left);
  places[index] = vec4(s.position, most);
  things[index] = uvec2(hit.instance, pack_normals(s.geometric_normal, s.normal));
}
