// Measures how far points are from a surface of triangles.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <vector>

namespace previz::model {

class SurfaceDistance {
 public:
  // Three indices for each triangle. Both lists must outlive this. Throws previz::Error if Embree
  // cannot hold the surface.
  SurfaceDistance(const std::vector<glm::vec3>& positions, const std::vector<unsigned>& indices);
  ~SurfaceDistance();
  SurfaceDistance(const SurfaceDistance&) = delete;
  SurfaceDistance& operator=(const SurfaceDistance&) = delete;

  // Returns the distance of the nearest triangle, infinity beyond `limit`.
  double from(const glm::vec3& point, double limit) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::model
