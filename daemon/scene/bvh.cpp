#include "daemon/scene/bvh.hpp"

namespace previz::scene {

Aabb transform_bounds(const Aabb& object_bounds, const glm::dmat4& world_from_object) {
  Aabb bounds;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 object((corner & 1 ? object_bounds.high : object_bounds.low).x,
                            (corner & 2 ? object_bounds.high : object_bounds.low).y,
                            (corner & 4 ? object_bounds.high : object_bounds.low).z, 1.0);
    const glm::vec3 world(glm::dvec3(world_from_object * object));
    bounds.low = glm::min(bounds.low, world);
    bounds.high = glm::max(bounds.high, world);
  }
  return bounds;
}

}  // namespace previz::scene
