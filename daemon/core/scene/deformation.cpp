#include "daemon/core/scene/deformation.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "daemon/core/scene/transform.hpp"

namespace previz::scene {
namespace {

// Returns the transform of a vertex: the mean of its joints', by weight.
glm::dmat4 blended(const Undeformed& mesh, std::size_t vertex, const Shape& shape) {
  glm::dmat4 sum(0);
  for (std::uint32_t i = 0; i < mesh.influences_per_vertex; ++i) {
    const Influence& influence = mesh.influences[vertex * mesh.influences_per_vertex + i];
    for (int k = 0; k < 4; ++k)
      if (influence.weights[k] != 0)
        sum += static_cast<double>(influence.weights[k]) *
               shape.joints[influence.joints[static_cast<std::size_t>(k)]];
  }
  return sum;
}

// Returns the matrix of cofactors, which takes normals along: that is the transposed inverse times
// the determinant, and it exists where the inverse does not.
glm::dmat3 cofactors(const glm::dmat3& m) {
  return {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])};
}

double farthest_coordinate(std::span<const glm::vec3> vectors) {
  float largest = 0;
  for (const glm::vec3& v : vectors)
    largest = std::max({largest, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return static_cast<double>(largest);
}

glm::dvec3 unit_or_up(const glm::dvec3& v) {
  const double size = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return size > 0 ? glm::normalize(v / size) : glm::dvec3(0, 0, 1);
}

}  // namespace

std::vector<double> weights_at(const WeightChannel& channel, std::size_t targets, double time_s) {
  const KeySegment s = segment_at(channel.times_s, time_s);
  const bool is_cubic = channel.interpolation == Interpolation::cubic_spline;
  const auto at = [&](std::size_t key, std::size_t part, std::size_t target) {
    return channel.values[(is_cubic ? 3 * key + part : key) * targets + target];
  };
  std::vector<double> weights(targets);
  for (std::size_t i = 0; i < targets; ++i) {
    const double before = at(s.before, 1, i), after = at(s.after, 1, i);
    if (s.before == s.after || channel.interpolation == Interpolation::step) {
      weights[i] = before;
    } else if (!is_cubic) {
      weights[i] = before + (after - before) * s.part;
    } else {
      const double t = s.part, t2 = t * t, t3 = t2 * t;
      weights[i] = (2 * t3 - 3 * t2 + 1) * before +
                   s.duration_s * (t3 - 2 * t2 + t) * at(s.before, 2, i) +
                   (3 * t2 - 2 * t3) * after + s.duration_s * (t3 - t2) * at(s.after, 0, i);
    }
  }
  return weights;
}

Shape shape_at_rest(const Deformation& deformation) {
  Shape shape{deformation.weights, {}};
  for (const Deformation::Joint& joint : deformation.joints)
    shape.joints.push_back(joint.file_from_joint * joint.joint_from_mesh);
  return shape;
}

Shape shape_at(const Deformation& deformation, const Animation& animation,
               std::span<const glm::dmat4> world_from_nodes, double time_s) {
  Shape shape = shape_at_rest(deformation);
  const glm::dmat4 file_from_world = glm::inverse(animation.world_from_file);
  for (std::size_t i = 0; i < deformation.joints.size(); ++i) {
    const Deformation::Joint& joint = deformation.joints[i];
    if (joint.node != no_node)
      shape.joints[i] = file_from_world * world_from_nodes[joint.node] * joint.joint_from_mesh;
  }
  if (!deformation.weight_channel.times_s.empty())
    shape.weights = weights_at(deformation.weight_channel, deformation.weights.size(),
                               played_time(animation, time_s));
  return shape;
}

Extent extent_of(const Undeformed& mesh) {
  Extent extent{farthest_coordinate(mesh.positions), {}};
  for (const MorphTarget& target : mesh.targets)
    extent.targets.push_back(farthest_coordinate(target.positions));
  return extent;
}

bool can_be_shown(const Shape& shape, const Extent& extent) {
  // Up to this coordinate, squares and products stay finite in single precision.
  constexpr double most = 1e15;
  double coordinate = extent.vertices;
  for (std::size_t i = 0; i < shape.weights.size(); ++i) {
    if (!(std::abs(shape.weights[i]) <= most)) return false;
    if (i < extent.targets.size()) coordinate += std::abs(shape.weights[i]) * extent.targets[i];
  }
  double largest = 0;
  for (const glm::dmat4& joint : shape.joints)
    for (int i = 0; i < 16; ++i) {
      const double size = std::abs(joint[i / 4][i % 4]);
      if (!(size <= most)) return false;
      largest = std::max(largest, size);
    }
  return coordinate <= most && largest * (3 * coordinate + 1) <= most;
}

DeformedVertices deformed(const Undeformed& mesh, const Shape& shape) {
  DeformedVertices result;
  result.positions.reserve(mesh.positions.size());
  result.normals.reserve(mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    glm::dvec3 position = mesh.positions[v], normal = mesh.normals[v];
    for (std::size_t t = 0; t < mesh.targets.size(); ++t) {
      position += shape.weights[t] * glm::dvec3(mesh.targets[t].positions[v]);
      if (!mesh.targets[t].normals.empty())
        normal += shape.weights[t] * glm::dvec3(mesh.targets[t].normals[v]);
    }
    if (mesh.influences_per_vertex > 0) {
      const glm::dmat4 object_from_mesh = blended(mesh, v, shape);
      position = glm::dvec3(object_from_mesh * glm::dvec4(position, 1));
      normal = cofactors(glm::dmat3(object_from_mesh)) * normal;
    }
    result.positions.emplace_back(position);
    result.normals.emplace_back(unit_or_up(normal));
  }
  for (std::size_t v = 0; mesh.flat && v + 2 < result.positions.size(); v += 3) {
    const glm::dvec3 a = result.positions[v];
    const glm::vec3 normal(unit_or_up(glm::cross(glm::dvec3(result.positions[v + 1]) - a,
                                                 glm::dvec3(result.positions[v + 2]) - a)));
    for (std::size_t k = 0; k < 3; ++k) result.normals[v + k] = normal;
  }
  return result;
}

}  // namespace previz::scene
