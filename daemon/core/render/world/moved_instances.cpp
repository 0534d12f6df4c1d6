#include "daemon/core/render/world/moved_instances.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <optional>

#include "daemon/core/render/world/bounds.hpp"
#include "shaders/lib/octahedral.h"

namespace previz::render {
namespace {

constexpr std::size_t most_moved = 16;
constexpr double least_arrival = 1e-3;
// The parts of a figure, its arms and legs, are this share of it wide: what has moved by as much
// may have moved out of its own shadow.
constexpr double width_of_parts = 0.25;

glm::dvec4 sphere_of(const GpuScene::Stance& stance) {
  return render::bounding_sphere(scene::Aabb{stance.low, stance.high}, stance.world_from_object);
}

// Returns the angle by which an instance has turned between two places.
double turn_between(const glm::dmat4& before, const glm::dmat4& now) {
  const glm::dmat3 motion = glm::dmat3(now) * glm::inverse(glm::dmat3(before));
  double trace = 0;
  for (int c = 0; c < 3; ++c) {
    const double length = glm::length(motion[c]);
    if (length > 0) trace += motion[c][c] / length;
  }
  return std::acos(std::clamp(0.5 * (trace - 1), -1.0, 1.0));
}

glm::vec4 relative_to(const glm::dvec3& camera, const glm::dvec4& sphere) {
  return {glm::vec3(glm::dvec3(sphere) - camera), static_cast<float>(std::max(sphere.w, 0.0))};
}

// Returns by how much the points of a mesh have moved in object space, at most; nothing where they
// cannot be compared.
std::optional<double> deformed_by(const GpuScene::Stance& before, const GpuScene::Stance& now) {
  if (before.deformed == now.deformed) return 0;
  if (!before.deformed || !now.deformed || before.deformed->reach != now.deformed->reach ||
      !before.deformed->shape || !now.deformed->shape)
    return {};
  return scene::most_moved(*now.deformed->reach, *before.deformed->shape, *now.deformed->shape);
}

double largest_scale(const glm::dmat4& m) {
  double scale = 0;
  for (int c = 0; c < 3; ++c) scale = std::max(scale, glm::length(glm::dvec3(m[c])));
  return scale;
}

// Returns what an instance has moved by, over its own width: the farthest of its points counts.
double moved_share(const GpuScene::Stance& before, const GpuScene::Stance& now,
                   const glm::dvec4& sphere, double turn) {
  const std::optional<double> deformed = deformed_by(before, now);
  if (before.material != now.material || before.presence != now.presence || !deformed) return 1;
  const glm::dvec3 middle = 0.5 * glm::dvec3(now.low + now.high);
  const glm::dvec3 was(before.world_from_object * glm::dvec4(middle, 1));
  const glm::dvec3 is(now.world_from_object * glm::dvec4(middle, 1));
  // The sphere around a mesh that deforms grows and shrinks by no more than its points move.
  const double grown = *deformed > 0 ? 0 : std::abs(sphere.w - sphere_of(before).w);
  const double of_parts = *deformed * largest_scale(now.world_from_object) / width_of_parts;
  return std::min(
      (glm::distance(was, is) + grown + of_parts) / std::max(2 * sphere.w, 1e-9) + 0.5 * turn, 1.0);
}

}  // namespace

MovedInstances moved_instances(const std::vector<GpuScene::Stance>& before,
                               const std::vector<GpuScene::Stance>& now, const glm::dvec3& camera) {
  MovedInstances result;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const GpuScene::Stance &was = before[i], &is = now[i];
    const bool is_empty = is.low.x > is.high.x && was.low.x > was.high.x;
    if (is == was || is_empty) continue;
    const glm::dvec4 sphere = sphere_of(is);
    gpu::GpuMoved moved{};
    moved.before = relative_to(camera, sphere_of(was));
    moved.now = relative_to(camera, sphere);
    const double turn = turn_between(was.world_from_object, is.world_from_object);
    moved.share = static_cast<float>(moved_share(was, is, sphere, turn));
    moved.turn = static_cast<float>(turn);
    moved.instance = static_cast<std::uint32_t>(i);
    result.moved.push_back(moved);
    if (is.emits || was.emits) result.rest = std::max<double>(result.rest, moved.share);
    if (is.may_be_dirac || was.may_be_dirac)
      result.throws_caustics = std::max<double>(result.throws_caustics, moved.share);
  }
  std::ranges::stable_sort(result.moved, std::greater(), [](const gpu::GpuMoved& moved) {
    return moved.share * std::max(moved.before.w, moved.now.w);
  });
  for (std::size_t i = most_moved; i < result.moved.size(); ++i)
    result.rest = std::max<double>(result.rest, result.moved[i].share);
  if (result.moved.size() > most_moved) result.moved.resize(most_moved);
  return result;
}

std::vector<gpu::GpuArrival> arrivals(const LightCells& environment,
                                      const std::vector<set::Light>& lamps) {
  std::vector<gpu::GpuArrival> result;
  double all = 0;
  const auto add = [&](const glm::dvec3& direction, const glm::dvec3& light, double width) {
    const double amount = largest_channel(light);
    all += amount;
    const double half = std::min(width, 0.5 * std::numbers::pi);
    result.push_back({glm::vec3(direction), static_cast<float>(amount), static_cast<float>(half),
                      static_cast<float>(std::cos(half)), static_cast<float>(std::sin(half))});
  };
  const auto side = static_cast<std::size_t>(std::lround(std::sqrt(environment.size())));
  // Each cell is 4 pi / side^2 of the sphere, and as wide as a cap of that size.
  const double width = 2 / static_cast<double>(std::max<std::size_t>(side, 1));
  for (std::size_t i = 0; i < environment.size(); ++i) {
    const glm::vec2 at = (glm::vec2(i % side, i / side) + 0.5f) * static_cast<float>(width) - 1.0f;
    add(glm::dvec3(octahedral_direction(at)), environment[i], width);
  }
  for (const set::Light& lamp : lamps) {
    if (lamp.type != set::LightType::directional) continue;
    const glm::dvec3 gain = glm::max(glm::dvec3(lamp.gain_real), lamp.gain_mixed * lamp.tint);
    add(-lamp.direction, gain * lamp.emission / (4 * std::numbers::pi), lamp.angular_radius_rad);
  }
  for (gpu::GpuArrival& arrival : result)
    arrival.share = all > 0 ? static_cast<float>(arrival.share / all) : 0.0f;
  std::erase_if(result, [](const gpu::GpuArrival& a) { return a.share < least_arrival; });
  return result;
}

}  // namespace previz::render
