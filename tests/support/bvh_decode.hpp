// Reads the texels of a mesh's tree back, for tests.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/scene/bvh.hpp"

namespace previz::test {

struct DecodedTriangle {
  std::array<glm::vec3, 3> corners;  // grid space, in the order of the primitive's corners
  std::uint32_t primitive = 0;
};

struct DecodedRecord {
  scene::Aabb bounds;                      // as the parent's planes say; empty for the root
  std::uint32_t level = 0;                 // 1: the root
  std::vector<scene::Aabb> children;       // of an inner node
  std::vector<DecodedTriangle> triangles;  // one or two if the record is a leaf
};

// Visits every record that a ray could meet, parents first. Returns how many empty slots there are
// whose box is not inverted, which must be none.
std::uint32_t visit(const scene::MeshBvh& bvh, const std::function<void(const DecodedRecord&)>& to);

}  // namespace previz::test
