// Gives a mesh a new shape: adds its morph targets and lets its vertices follow their joints
// (shaders/README.md, "Deforming meshes"; daemon/core/scene/deformation.hpp does the same in double
// precision).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;
layout(scalar, push_constant) uniform Deform { GpuDeform deform; };
layout(scalar) readonly buffer Undeformed { vec4 undeformed[]; };  // position, normal of a vertex
layout(scalar) readonly buffer Influences { GpuInfluence influences[]; };
layout(scalar) readonly buffer Joints { vec4 joint_rows[]; };  // three of a joint
layout(scalar) readonly buffer MorphOffsets { GpuMorphOffset morph_offsets[]; };
layout(scalar) readonly buffer MorphWeights { GpuMorphWeight morph_weights[]; };
layout(scalar) buffer Shaped { vec4 shaped_vertices[]; };  // VERTICES, to write

struct Rows {
  vec4 x, y, z;
};

// A joint of no weight may be anywhere: it names what an unused influence does.
void add_joint(inout Rows sum, uint joint, float weight) {
  if (weight == 0.0) return;
  const uint first = 3u * (deform.first_joint + joint);
  sum.x += weight * joint_rows[first];
  sum.y += weight * joint_rows[first + 1u];
  sum.z += weight * joint_rows[first + 2u];
}

// Returns the mean of the transforms of a vertex's joints, by weight.
Rows blended_joints(uint vertex) {
  Rows sum = Rows(vec4(0.0), vec4(0.0), vec4(0.0));
  for (uint i = 0u; i < deform.influences_per_vertex; ++i) {
    const GpuInfluence of =
        influences[deform.first_influence + vertex * deform.influences_per_vertex + i];
    add_joint(sum, of.joints_low & 0xffffu, of.weights.x);
    add_joint(sum, of.joints_low >> 16, of.weights.y);
    add_joint(sum, of.joints_high & 0xffffu, of.weights.z);
    add_joint(sum, of.joints_high >> 16, of.weights.w);
  }
  return sum;
}

float largest(vec3 v) { return max(max(abs(v.x), abs(v.y)), abs(v.z)); }

// Returns the vector with a length of 1, or straight up where it has none. It is scaled first,
// because the square of a small length underflows.
vec3 unit_or_up(vec3 v) {
  const float size = largest(v);
  return size > 0.0 ? normalize(v / size) : vec3(0.0, 0.0, 1.0);
}

// Returns a vertex in its new shape, and its normal, which is not unit.
vec3 shaped(uint vertex, out vec3 normal) {
  const uint first = 2u * (deform.first_undeformed + vertex);
  vec3 position = undeformed[first].xyz;
  normal = undeformed[first + 1u].xyz;
  for (uint i = 0u; i < deform.weights; ++i) {
    const GpuMorphWeight target = morph_weights[deform.first_weight + i];
    const GpuMorphOffset offset =
        morph_offsets[deform.first_offset + target.target * deform.vertices + vertex];
    position += target.weight * offset.position;
    normal += target.weight * offset.normal;
  }
  if (deform.influences_per_vertex == 0u) return position;
  const Rows rows = blended_joints(vertex);
  // Normals go by the matrix of cofactors: the transposed inverse times the determinant.
  const float size = max(max(largest(rows.x.xyz), largest(rows.y.xyz)), largest(rows.z.xyz));
  if (size > 0.0) {
    const vec3 x = rows.x.xyz / size;
    const vec3 y = rows.y.xyz / size;
    const vec3 z = rows.z.xyz / size;
    normal = vec3(dot(cross(y, z), normal), dot(cross(z, x), normal), dot(cross(x, y), normal));
  }
  return vec3(dot(rows.x.xyz, position) + rows.x.w, dot(rows.y.xyz, position) + rows.y.w,
              dot(rows.z.xyz, position) + rows.z.w);
}

void main() {
  const uint vertex = gl_GlobalInvocationID.x;
  if (vertex >= deform.vertices) return;
  vec3 normal;
  const vec3 position = shaped(vertex, normal);
  if (deform.flat_normals != 0u) {
    const uint corner = vertex - vertex % 3u;
    vec3 unused;
    const vec3 a = shaped(corner, unused);
    const vec3 along1 = shaped(corner + 1u, unused) - a;
    const vec3 along2 = shaped(corner + 2u, unused) - a;
    const float size = max(largest(along1), largest(along2));
    normal = size > 0.0 ? cross(along1 / size, along2 / size) : vec3(0.0);
  }
  // The fourth components are texture coordinates, which stay.
  const uint to = 2u * (deform.first_vertex + vertex);
  shaped_vertices[to].xyz = position;
  shaped_vertices[to + 1u].xyz = unit_or_up(normal);
}
