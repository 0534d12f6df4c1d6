#include "tests/support/real_bodies.hpp"

#include "daemon/core/fit/light_edge.hpp"
#include "daemon/core/tracking/camera_pose.hpp"

namespace previz::test {

std::vector<glm::dvec3> sheet(const std::array<glm::dvec3, 4>& c) {
  return {c[0], c[1], c[2], c[0], c[2], c[3]};
}

std::vector<glm::dvec3> box(const glm::dvec3& low, const glm::dvec3& size) {
  std::vector<glm::dvec3> triangles;
  for (int axis = 0; axis < 3; ++axis)
    for (const double end : {0.0, 1.0}) {
      std::array<glm::dvec3, 4> corners;
      for (std::size_t k = 0; k < 4; ++k) {
        glm::dvec3 at(end);
        at[(axis + 1) % 3] = k == 1 || k == 2;
        at[(axis + 2) % 3] = k >= 2;
        corners[k] = low + at * size;
      }
      const auto side = sheet(corners);
      triangles.insert(triangles.end(), side.begin(), side.end());
    }
  return triangles;
}

std::vector<glm::dvec3> table() {
  return sheet({{{-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0}}});
}

RealScene::RealScene(const std::vector<std::vector<glm::dvec3>>& bodies) : RealScene() {
  for (const auto& body : bodies) add(body);
}

void RealScene::add(const std::vector<glm::dvec3>& triangles, std::uint32_t presence) {
  scene::Mesh mesh;
  for (const glm::dvec3& p : triangles) {
    const auto i = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.push_back(p);
    if (i % 3 == 0) mesh.triangles.push_back({i, i + 1, i + 2});
  }
  const auto number = static_cast<std::uint32_t>(scene.meshes.size());
  scene.meshes.push_back(std::move(mesh));
  scene::Instance instance;
  instance.mesh = instance.object = number;
  instance.presence = presence;
  scene.instances.push_back(instance);
  set.objects.emplace_back();
}

ObserverCalibration camera_of_tests() {
  ObserverCalibration camera;
  camera.intrinsics = plain_lens(1280, 960, 1200);
  return camera;
}

glm::dmat4 place_of_camera() {
  return camera_looking({0.5, -0.9, 0.9}, {0, 0.1, 0.1});
}

glm::dvec2 shown(const glm::dvec3& point) {
  const auto pose = tracking::camera_from_world(place_of_camera());
  return fit::on_pinhole(camera_of_tests().intrinsics, pose.rotation * point + pose.translation)
      .value();
}

}  // namespace previz::test
