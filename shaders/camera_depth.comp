// Finds what the camera sees of the real world: the first surface at the middle of each pixel
// (shaders/README.md, "Camera radiance").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/trace.glsl"

layout(scalar) writeonly buffer SeenBuffer { GpuSeen seen[]; };

void main() {
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  const uvec2 pixel = uvec2(index % frame.width, index / frame.width);
  const vec3 ray = vec3(calibrated_ray(pixel, vec2(0.5)), 1.0);
  const float depth_of_unit = inversesqrt(dot(ray, ray));
  const vec3 direction = transform_vector(frame.world_from_camera, ray * depth_of_unit);
  Hit hit;
  seen[index] = GpuSeen(0.0, NO_INDEX);
  if (!trace_closest(vec3(0.0), direction, 0.0, 3.4e38, WORLD_REAL, hit)) return;
  if (material_at(instance_at(hit.instance).material).alpha_mode != ALPHA_OPAQUE) return;
  // A mixed path does not meet what is removed from the picture, however close behind it the path ends.
  if (instance_at(hit.instance).presence != WORLD_BOTH) return;
  seen[index] = GpuSeen(1.0 / (hit.t * depth_of_unit), hit.instance);
}
