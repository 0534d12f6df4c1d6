// Ray queries of the reference tracer: one Embree scene a world, hits refined in double precision.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "daemon/core/scene/scene.hpp"

namespace previz::truth {

struct Ray {
  glm::dvec3 origin{0};
  glm::dvec3 direction{0, 0, 1};  // unit
};

// A point of a mesh.
struct MeshPoint {
  std::uint32_t instance = 0;
  std::uint32_t triangle = 0;
  glm::dvec3 weights{1, 0, 0};  // of the triangle's vertices
};

struct Hit : MeshPoint {
  double distance = 0;
  glm::dvec3 position{0};
  glm::dvec3 geometric_normal{0};  // unit, on the side the triangle's winding faces
  glm::dvec3 shading_normal{0};    // unit, on the geometric normal's side
  double offset = 0;               // how far a new ray must start from the surface, metres
};

struct Triangle {
  glm::dvec3 v0, v1, v2;
};

// Holds the bottom-level hierarchies of a scene; the scene must outlive it.
class Geometry {
 public:
  explicit Geometry(const scene::Scene& scene);
  ~Geometry();
  Geometry(const Geometry&) = delete;
  Geometry& operator=(const Geometry&) = delete;

  // Builds the worlds' top levels with `origin` as the new origin, so that what is near the camera
  // keeps its precision. Everything below is relative to it.
  void place(const glm::dvec3& origin);

  // `world` is scene::world_mixed, world_real, or world_both: what is present in either.
  std::optional<Hit> closest(const Ray& ray, std::uint32_t world) const;
  bool blocked(const Ray& ray, double distance, std::uint32_t world) const;

  Triangle triangle(std::uint32_t instance, std::uint32_t index) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::truth
