// Axis-aligned boxes, and how well trees over them are built.
#pragma once

#include <glm/common.hpp>
#include <glm/vec3.hpp>

namespace previz::scene {

struct Aabb {
  glm::vec3 low{1e30f};
  glm::vec3 high{-1e30f};
};

inline Aabb merged(const Aabb& a, const Aabb& b) {
  return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

// Returns half the surface area.
inline double half_area(const Aabb& box) {
  const glm::dvec3 size = glm::dvec3(box.high) - glm::dvec3(box.low);
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

// The qualities are Embree's Morton, binned SAH, and binned SAH with spatial splits.
enum class BvhQuality { low, medium, high };

}  // namespace previz::scene
