#include "tests/support/figure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <utility>

#include "tests/support/scenes.hpp"

namespace previz::test {
namespace {

// A vertex at this height follows the joints on either side of it, in proportion.
scene::Influence influence_at(double height, int joints) {
  const double at = std::clamp(height * joints - 0.5, 0.0, joints - 1.0);
  const int low = std::min(static_cast<int>(at), joints - 1);
  const int high = std::min(low + 1, joints - 1);
  const auto share = static_cast<float>(at - low);
  return {{static_cast<std::uint16_t>(low), static_cast<std::uint16_t>(high)},
          {1 - share, share, 0, 0}};
}

// Adds a mesh that deforms, at rest, and returns its index in Scene::deformations.
std::uint32_t add_deforming(scene::Scene& scene, const scene::Mesh& mesh, std::uint32_t material,
                            const glm::dmat4& world_from_object, std::uint32_t presence) {
  scene::Deformation deformation;
  deformation.mesh = add_mesh(scene, mesh);
  deformation.instance =
      add_instance(scene, deformation.mesh, material, world_from_object, presence);
  deformation.object = scene.instances[deformation.instance].object;
  scene.deformations.push_back(std::move(deformation));
  return static_cast<std::uint32_t>(scene.deformations.size() - 1);
}

}  // namespace

scene::Mesh limb_mesh(int rings, int segments, int joints) {
  scene::Mesh mesh;
  mesh.name = "limb";
  scene::Undeformed& undeformed = mesh.undeformed;
  undeformed.influences_per_vertex = 1;
  for (int ring = 0; ring <= rings; ++ring)
    for (int segment = 0; segment < segments; ++segment) {
      const double height = static_cast<double>(ring) / rings;
      const double angle = 2 * std::numbers::pi * segment / segments;
      const glm::dvec3 outward(std::cos(angle), std::sin(angle), 0);
      mesh.positions.emplace_back(0.1 * outward + glm::dvec3(0, 0, height));
      mesh.normals.emplace_back(outward);
      undeformed.influences.push_back(influence_at(height, joints));
    }
  const auto at = [&](int ring, int segment) {
    return static_cast<std::uint32_t>(ring * segments + segment % segments);
  };
  for (int ring = 0; ring < rings; ++ring)
    for (int segment = 0; segment < segments; ++segment) {
      mesh.triangles.emplace_back(at(ring, segment), at(ring, segment + 1), at(ring + 1, segment));
      mesh.triangles.emplace_back(at(ring, segment + 1), at(ring + 1, segment + 1),
                                  at(ring + 1, segment));
    }
  undeformed.positions = mesh.positions;
  undeformed.normals = mesh.normals;
  return mesh;
}

std::vector<scene::Deformation::Joint> limb_joints(int joints) {
  std::vector<scene::Deformation::Joint> result(static_cast<std::size_t>(joints));
  for (int i = 0; i < joints; ++i) {
    const glm::dvec3 foot(0, 0, static_cast<double>(i) / joints);
    result[static_cast<std::size_t>(i)].joint_from_mesh = glm::translate(glm::dmat4(1), -foot);
    result[static_cast<std::size_t>(i)].file_from_joint = glm::translate(glm::dmat4(1), foot);
  }
  return result;
}

scene::Mesh squeezed_ball_mesh(double radius, int segments, int rings) {
  scene::Mesh mesh = uv_sphere_mesh(radius, segments, rings);
  scene::MorphTarget target;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const glm::vec3& p = mesh.positions[i];
    const glm::vec3& n = mesh.normals[i];
    target.positions.emplace_back(0.5f * p.x, 0, -0.5f * p.z);
    // An ellipsoid's normal goes by the inverse of its stretch.
    target.normals.push_back(glm::vec3(n.x / 1.5f, n.y, n.z / 0.5f) - n);
  }
  mesh.undeformed.positions = mesh.positions;
  mesh.undeformed.normals = mesh.normals;
  mesh.undeformed.targets = {std::move(target)};
  return mesh;
}

std::uint32_t add_limb(scene::Scene& scene, const scene::Mesh& mesh, int joints,
                       std::uint32_t material, const glm::dmat4& world_from_object,
                       std::uint32_t presence) {
  const auto index = add_deforming(scene, mesh, material, world_from_object, presence);
  scene.deformations[index].joints = limb_joints(joints);
  return index;
}

std::uint32_t add_squeezed_ball(scene::Scene& scene, const scene::Mesh& mesh,
                                std::uint32_t material, const glm::dmat4& world_from_object,
                                std::uint32_t presence) {
  const auto index = add_deforming(scene, mesh, material, world_from_object, presence);
  scene.deformations[index].weights = {0};
  return index;
}

scene::Shape bent_limb(const scene::Deformation& limb, double angle_rad) {
  scene::Shape shape;
  glm::dmat4 file_from_joint(1);
  for (std::size_t i = 0; i < limb.joints.size(); ++i) {
    if (i > 0)
      file_from_joint = glm::rotate(
          glm::translate(file_from_joint, {0, 0, 1.0 / static_cast<double>(limb.joints.size())}),
          angle_rad, glm::dvec3(0, 1, 0));
    shape.joints.push_back(file_from_joint * limb.joints[i].joint_from_mesh);
  }
  return shape;
}

scene::Scene posed(scene::Scene scene, const std::vector<scene::Shape>& shapes) {
  for (std::size_t i = 0; i < scene.deformations.size(); ++i) {
    scene::Mesh& mesh = scene.meshes[scene.deformations[i].mesh];
    scene::DeformedVertices vertices = scene::deformed(mesh.undeformed, shapes[i]);
    mesh.positions = std::move(vertices.positions);
    mesh.normals = std::move(vertices.normals);
    mesh.undeformed = {};
  }
  scene.deformations.clear();
  return scene;
}

}  // namespace previz::test
