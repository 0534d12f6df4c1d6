#include "daemon/core/scene/seen_backs.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numbers>

namespace previz::scene {
namespace {

constexpr double most_of_front = 0.125;  // of what is seen
// Each is tried on all triangles of an object: fewer than takes as long as reading it.
constexpr std::size_t rays_of_a_part = 24, most_rays = 96, fewest_rays = 8;

struct Outermost {
  double distance = -std::numeric_limits<double>::infinity();
  std::size_t part = 0;
  bool is_back = false;
};

// Finds the triangle of a mesh that is farthest along a line, and so is seen from there, if it is
// farther than what was found (Moeller and Trumbore 1997).
void meet(const Mesh& mesh, std::size_t part, const glm::dvec3& origin, const glm::dvec3& direction,
          Outermost& found) {
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a = mesh.positions[t.x];
    const glm::dvec3 edge1 = glm::dvec3(mesh.positions[t.y]) - a;
    const glm::dvec3 edge2 = glm::dvec3(mesh.positions[t.z]) - a;
    const glm::dvec3 p = glm::cross(direction, edge2);
    const double volume = glm::dot(edge1, p);
    if (volume == 0) continue;
    const glm::dvec3 from = origin - a;
    const double u = glm::dot(from, p) / volume;
    if (!(u >= 0 && u <= 1)) continue;
    const glm::dvec3 q = glm::cross(from, edge1);
    const double v = glm::dot(direction, q) / volume;
    if (!(v >= 0 && u + v <= 1)) continue;
    const double distance = glm::dot(edge2, q) / volume;
    if (distance > found.distance) found = {distance, part, volume > 0};
  }
}

// Directions that are spread evenly (Fibonacci's sphere).
glm::dvec3 direction_of(std::size_t ray, std::size_t rays) {
  const double z = 1 - (2 * static_cast<double>(ray) + 1) / static_cast<double>(rays);
  const double angle = static_cast<double>(ray) * std::numbers::pi * (3 - std::sqrt(5.0));
  const double across = std::sqrt(1 - z * z);
  return {across * std::cos(angle), across * std::sin(angle), z};
}

}  // namespace

std::vector<bool> are_seen_from_behind(std::span<const Mesh* const> meshes, std::uint64_t& tries) {
  std::map<const Mesh*, std::size_t> place;
  std::vector<const Mesh*> parts;
  std::uint64_t triangles = 0;
  for (const Mesh* const mesh : meshes) {
    if (!place.emplace(mesh, parts.size()).second) continue;
    parts.push_back(mesh);
    triangles += mesh->triangles.size();
  }
  const std::uint64_t rays_left = tries / std::max<std::uint64_t>(triangles, 1);
  const std::size_t rays =
      std::min<std::uint64_t>(std::min(rays_of_a_part * parts.size(), most_rays), rays_left);
  if (rays < fewest_rays) return std::vector<bool>(meshes.size());
  tries -= rays * triangles;
  std::vector<std::size_t> seen(parts.size()), backs(parts.size());
  for (std::size_t ray = 0; ray < rays; ++ray) {
    const Mesh& aim = *parts[ray % parts.size()];
    const std::size_t each = std::max(rays / parts.size(), std::size_t{1});
    const glm::uvec3& t = aim.triangles[ray / parts.size() % each * aim.triangles.size() / each];
    // Off the centre, where no edge of a regular mesh is.
    const glm::dvec3 at = 0.41 * glm::dvec3(aim.positions[t.x]) +
                          0.36 * glm::dvec3(aim.positions[t.y]) +
                          0.23 * glm::dvec3(aim.positions[t.z]);
    Outermost found;
    for (std::size_t i = 0; i < parts.size(); ++i)
      meet(*parts[i], i, at, direction_of(ray, rays), found);
    ++seen[found.part];
    backs[found.part] += found.is_back ? 1 : 0;
  }
  std::vector<bool> result;
  for (const Mesh* const mesh : meshes) {
    const std::size_t i = place.at(mesh);
    result.push_back(static_cast<double>(backs[i]) > most_of_front * static_cast<double>(seen[i]));
  }
  return result;
}

}  // namespace previz::scene
