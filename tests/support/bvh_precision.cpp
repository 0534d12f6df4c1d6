#include "tests/support/bvh_precision.hpp"

#include <algorithm>
#include <cmath>

namespace previz::test {
namespace {

// 2^-24 is half an ulp of 1. Transforming the ray takes up to 8 roundings, projecting a vertex 5, a
// weight 3, and Embree has as many of its own.
constexpr double roundings = 32;
constexpr double half_ulp = 0x1p-24;

double largest(const glm::dvec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

// How much a matrix may blow rounding up on the way to object space and back.
double condition(const glm::dmat4& m) {
  const glm::dmat3 linear(m), inverse = glm::inverse(linear);
  const auto norm = [](const glm::dmat3& a) {
    return std::sqrt(glm::dot(a[0], a[0]) + glm::dot(a[1], a[1]) + glm::dot(a[2], a[2]));
  };
  return std::max(1.0, norm(linear) * norm(inverse) / 3);
}

}  // namespace

double ExactHit::least_weight() const {
  return std::min({weights[0], weights[1], weights[2]});
}

ExactHit exact_hit(const scene::Scene& scene, std::uint32_t instance, std::uint32_t primitive,
                   const bench::Ray& ray) {
  const scene::Instance& placed = scene.instances[instance];
  const scene::Mesh& mesh = scene.meshes[placed.mesh];
  const glm::dvec3 origin(ray.origin), direction(ray.direction);
  const glm::dvec3 d = glm::normalize(direction);
  const glm::dvec3 x = glm::normalize(
      glm::cross(d, std::abs(d.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
  const glm::dvec3 y = glm::cross(d, x);
  double reach = std::max(largest(origin), largest(glm::dvec3(placed.world_from_object[3])));
  std::array<glm::dvec3, 3> p;
  for (int i = 0; i < 3; ++i) {
    const glm::dvec4 object(glm::dvec3(mesh.positions[mesh.triangles[primitive][i]]), 1.0);
    const glm::dvec3 world(placed.world_from_object * object);
    reach = std::max({reach, largest(world), largest(world - origin)});
    const glm::dvec3 v = world - origin;
    p[static_cast<std::size_t>(i)] = {glm::dot(v, x), glm::dot(v, y), glm::dot(v, d)};
  }
  const auto cross = [](const glm::dvec3& a, const glm::dvec3& b) { return a.x * b.y - a.y * b.x; };
  const std::array<double, 3> areas{cross(p[1], p[2]), cross(p[2], p[0]), cross(p[0], p[1])};
  const double area = areas[0] + areas[1] + areas[2];
  ExactHit hit;
  hit.proper = area != 0;
  if (!hit.proper) return hit;
  double perimeter = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    hit.weights[i] = areas[i] / area;
    hit.t += hit.weights[i] * p[i].z;
    const glm::dvec3 side = p[(i + 1) % 3] - p[i];
    perimeter += std::hypot(side.x, side.y);
  }
  const double length = glm::length(direction);
  const double shift = roundings * half_ulp * reach * condition(placed.world_from_object);
  const auto [near, far] = std::minmax({p[0].z, p[1].z, p[2].z});
  hit.t /= length;
  hit.weight_error = shift * perimeter / std::abs(area);
  hit.t_error = (shift + std::min(1.0, hit.weight_error) * (far - near)) / length;
  return hit;
}

bool agree(const scene::Scene& scene, const bench::Ray& ray, const bench::TracedHit& a,
           const bench::TracedHit& b) {
  if (a.t < 0 && b.t < 0) return true;
  // The nearer hit decides: was it a hit beyond doubt, the other tracer had to find it.
  const auto decided = [&](const bench::TracedHit& hit, const bench::TracedHit& other) {
    const ExactHit exact = exact_hit(scene, hit.instance, hit.primitive, ray);
    if (!exact.possibly()) return false;
    if (std::abs(hit.t - exact.t) > exact.t_error && exact.surely()) return false;
    if (other.t >= 0) {
      const ExactHit exact_other = exact_hit(scene, other.instance, other.primitive, ray);
      if (std::abs(hit.t - other.t) <= exact.t_error + exact_other.t_error) return true;
    }
    const bool at_an_end = std::abs(exact.t - ray.t_min) <= exact.t_error ||
                           std::abs(exact.t - ray.t_max) <= exact.t_error;
    return !exact.surely() || at_an_end;
  };
  const bool a_first = b.t < 0 || (a.t >= 0 && a.t <= b.t);
  return a_first ? decided(a, b) : decided(b, a);
}

}  // namespace previz::test
