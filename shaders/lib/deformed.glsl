// Finds where the points of a mesh that deforms were in the frame before.
#ifndef PREVIZ_DEFORMED_GLSL
#define PREVIZ_DEFORMED_GLSL

#include "shaders/lib/history.glsl"
#include "shaders/lib/scene.glsl"
#include "shaders/lib/trace.glsl"

// Position and normal of each vertex that deforms, in the frame before and in object space.
layout(scalar) readonly buffer PastPoints { vec4 past_points[]; };

vec3 past_point(GpuInstance instance, GpuMotion motion, uint vertex) {
  const vec3 point = past_points[2u * (vertex + motion.points)].xyz;
  return moved(motion.before_from_now, transform_point(instance.world_from_object, point));
}

// Returns where the point of a hit was in the frame before, from its camera. `bent` is by which angle the surface
// has turned there, beside what the whole instance has.
vec3 position_before(Hit hit, Surface s, GpuMotion motion, out float bent) {
  bent = 0.0;
  if (motion.points == NO_INDEX) return moved(motion.before_from_now, s.position);
  const GpuInstance instance = instance_at(hit.instance);
  const uvec3 index = fetch(triangles, int(instance.first_triangle + hit.primitive)).xyz;
  const vec3 a = past_point(instance, motion, index.x);
  const vec3 b = past_point(instance, motion, index.y);
  const vec3 c = past_point(instance, motion, index.z);
  const vec3 face = cross(b - a, c - a);
  const vec3 now = rotated(motion.before_from_now, s.geometric_normal);
  const float size = length(face) * length(now);
  if (size > 0.0) bent = acos(clamp(abs(dot(face, now)) / size, 0.0, 1.0));
  return (1.0 - hit.barycentrics.x - hit.barycentrics.y) * a + hit.barycentrics.x * b +
         hit.barycentrics.y * c;
}

#endif
