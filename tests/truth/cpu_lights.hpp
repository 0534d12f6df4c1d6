// Every emitter of one world but the environment: the set's lamps and emissive meshes.
#pragma once

#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "tests/truth/cpu_geometry.hpp"
#include "tests/truth/cpu_random.hpp"

namespace previz::truth {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

// A point of a light as seen from a receiver.
struct LightSample {
  glm::dvec3 direction{0, 0, 1};  // unit, towards the light
  double distance = 0;            // infinity for distant lights
  // Radiance over pdf, or irradiance on a facing plane for a light of zero size.
  glm::dvec3 value{0};
  double pdf = 0;  // per steradian; 0: a light of zero size, no ray meets it
};

// A lamp crossed by a ray.
struct LampHit {
  double distance = 0;
  glm::dvec3 radiance{0};
  double pdf = 0;  // of LightSample, for this direction
};

// A lamp, `light.position` relative to the placed origin, gain applied to the emission.
LightSample sample_lamp(const set::Light& light, const glm::dvec3& receiver, Random& random);
// Nothing but lamps with an extent can be met; rectangles emit to one side, spheres outwards, a
// directional light with an angular radius is a disc of uniform radiance at infinity.
std::optional<LampHit> meet_lamp(const set::Light& light, const Ray& ray);

// The triangles that emit in one world, chosen by area times the emission's luminance.
class EmissiveMeshes {
 public:
  EmissiveMeshes(const scene::Scene& scene, const Geometry& geometry, std::uint32_t world);
  bool empty() const { return cumulative_.empty(); }

  struct Sample : MeshPoint {
    glm::dvec3 position{0};
    glm::dvec3 normal{0};
    double area_pdf = 0;  // per square metre
  };
  Sample sample(Random& random) const;
  // Per square metre; 0 where the triangle does not emit.
  double area_pdf(std::uint32_t instance, std::uint32_t triangle) const;

 private:
  const Geometry& geometry_;
  struct Entry {
    std::uint32_t instance, triangle;
    double area;
  };
  std::vector<Entry> entries_;
  std::vector<double> cumulative_;           // ends at 1
  std::vector<std::ptrdiff_t> first_entry_;  // of an instance; -1: emits nothing
};

}  // namespace previz::truth
