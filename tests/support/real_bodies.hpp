// Boxes and sheets as a scene that is real, and a camera that looks at them.
#pragma once

#include "daemon/core/fit/real_model.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::test {

// Triangles of a box that begins at `low`: every side has corners of its own, as glTF files do.
std::vector<glm::dvec3> box(const glm::dvec3& low, const glm::dvec3& size);

// Two triangles of a sheet with these corners, in this order.
std::vector<glm::dvec3> sheet(const std::array<glm::dvec3, 4>& corners);

// A table of 8 x 8 m at height 0.
std::vector<glm::dvec3> table();

// A scene, each object of which is one body, and its set.
struct RealScene {
  scene::Scene scene;
  set::Set set;

  RealScene() { scene.materials.resize(1); }
  explicit RealScene(const std::vector<std::vector<glm::dvec3>>& bodies);
  void add(const std::vector<glm::dvec3>& triangles, std::uint32_t presence = scene::world_both);
  fit::RealModel model() const { return {scene, set}; }
};

// The cube of 0.2 m on the table that the tests look at, from 1.3 m away.
inline const glm::dvec3 cube_low{-0.1, 0, 0}, cube_size{0.2};
ObserverCalibration camera_of_tests();
glm::dmat4 place_of_camera();

// Returns where the camera's pinhole shows a point of the world.
glm::dvec2 shown(const glm::dvec3& point);

}  // namespace previz::test
