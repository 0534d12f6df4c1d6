#include "daemon/tools/model/on_phantom.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "daemon/core/fit/real_model.hpp"

namespace previz::model {
namespace {

constexpr double reach_m = 0.02;
// What stands higher than this on the surface beside a tag is not what the tag lies on.
constexpr double same_surface_m = 2e-3;

bool is_surface(const scene::Instance& instance, const set::Set& set) {
  return set.objects[instance.object].presence == set::Presence::phantom &&
         fit::stands_still(instance, set) && instance.tag == scene::TagPart::none;
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

PhantomSurface::PhantomSurface(const scene::Scene& scene, const set::Set& set) {
  lighting::Triangles triangles;
  for (const scene::Instance& instance : scene.instances)
    if (is_surface(instance, set)) fit::append(scene, instance, triangles);
  if (!triangles.empty()) surface_.emplace(triangles, glm::dvec3(0));
}

std::optional<double> PhantomSurface::put(NamedMesh& named, const Plane& ground) const {
  std::vector<glm::vec3>& positions = named.mesh.positions;
  if (!surface_ || positions.empty()) return {};
  std::vector<std::optional<double>> offsets;
  std::vector<double> known;
  for (const glm::vec3& position : positions) {
    const glm::dvec3 p(position);
    const glm::dvec3 below = p - glm::dot(p - ground.at, ground.normal) * ground.normal;
    const auto distance = surface_->distance(below + reach_m * ground.normal, -ground.normal);
    offsets.emplace_back();
    if (!distance || *distance > 2 * reach_m) continue;
    offsets.back() = reach_m - *distance;
    known.push_back(*offsets.back());
  }
  if (known.empty()) return {};
  const double median = median_of(known);
  double most = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const bool is_same = offsets[i] && std::abs(*offsets[i] - median) < same_surface_m;
    const double offset = is_same ? *offsets[i] : median;
    positions[i] = glm::dvec3(positions[i]) + offset * ground.normal;
    most = std::max(most, std::abs(offset));
  }
  return most;
}

}  // namespace previz::model
