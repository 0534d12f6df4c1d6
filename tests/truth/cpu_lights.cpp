#include "tests/truth/cpu_lights.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <optional>

#include "tests/truth/cpu_luminance.hpp"

namespace previz::truth {
namespace {

using std::numbers::pi;

// Uniform in the cone of half angle with this 1 - cos around the axis; 1 - cos keeps small cones
// exact.
glm::dvec3 sample_cone(const glm::dvec3& axis, double one_minus_cos, glm::dvec2 random) {
  const double d = random.x * one_minus_cos;
  const double sine = std::sqrt(std::max(0.0, d * (2 - d)));
  const glm::dvec3 helper = std::abs(axis.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 x = glm::normalize(glm::cross(axis, helper));
  const glm::dvec3 y = glm::cross(axis, x);
  const double phi = 2 * pi * random.y;
  return glm::normalize((1 - d) * axis + sine * (std::cos(phi) * x + std::sin(phi) * y));
}

double cone_one_minus_cos(double half_angle) {
  const double s = std::sin(half_angle / 2);
  return 2 * s * s;
}

LightSample sample_point(const set::Light& light, const glm::dvec3& receiver) {
  const glm::dvec3 to_light = light.position - receiver;
  const double distance = glm::length(to_light);
  LightSample s{to_light / distance, distance, light.emission / (distance * distance), 0};
  if (light.type == set::LightType::spot) {
    const double inner = std::cos(light.inner_cone_rad);
    const double outer = std::cos(light.outer_cone_rad);
    const double cosine = -glm::dot(s.direction, light.direction);
    double t = cosine >= inner ? 1 : 0;
    if (inner > outer) t = std::clamp((cosine - outer) / (inner - outer), 0.0, 1.0);
    s.value *= t * t * (3 - 2 * t);
  }
  return s;
}

LightSample sample_directional(const set::Light& light, Random& random) {
  if (light.angular_radius_rad <= 0) return {-light.direction, infinity, light.emission, 0};
  const double one_minus_cos = cone_one_minus_cos(light.angular_radius_rad);
  const double sine = std::sin(light.angular_radius_rad);
  const double pdf = 1 / (2 * pi * one_minus_cos);
  const glm::dvec3 radiance = light.emission / (pi * sine * sine);
  return {sample_cone(-light.direction, one_minus_cos, random.uniform2()), infinity, radiance / pdf,
          pdf};
}

struct RectangleAxes {
  glm::dvec3 width, height;  // full extents
};
RectangleAxes rectangle_axes(const set::Light& light) {
  const glm::dvec3 side = glm::normalize(glm::cross(light.up, light.direction));
  return {side * light.width_m, glm::cross(light.direction, side) * light.height_m};
}

LightSample sample_rectangle(const set::Light& light, const glm::dvec3& receiver, Random& random) {
  const auto [width, height] = rectangle_axes(light);
  const glm::dvec2 u = random.uniform2() - 0.5;
  const glm::dvec3 to_light = light.position + u.x * width + u.y * height - receiver;
  const double distance = glm::length(to_light);
  const glm::dvec3 direction = to_light / distance;
  const double cosine = -glm::dot(direction, light.direction);
  if (cosine <= 0) return {direction, distance, glm::dvec3(0), 1};
  const double pdf = distance * distance / (cosine * light.width_m * light.height_m);
  return {direction, distance, light.emission / pdf, pdf};
}

struct SphereView {
  glm::dvec3 axis;
  double distance;       // to the centre
  double one_minus_cos;  // of the cone it fills
};
std::optional<SphereView> view_sphere(const set::Light& light, const glm::dvec3& receiver) {
  const glm::dvec3 to_centre = light.position - receiver;
  const double distance = glm::length(to_centre);
  if (distance <= light.radius_m) return std::nullopt;  // it emits outwards only
  const double sine = light.radius_m / distance;
  return SphereView{to_centre / distance, distance, sine * sine / (1 + std::sqrt(1 - sine * sine))};
}

// Distance to the sphere's near side.
std::optional<double> meet_sphere(const set::Light& light, const Ray& ray) {
  const glm::dvec3 to_centre = light.position - ray.origin;
  const double along = glm::dot(to_centre, ray.direction);
  const double beside = glm::length(to_centre - along * ray.direction);
  if (along <= 0 || beside >= light.radius_m) return std::nullopt;
  return along - std::sqrt(light.radius_m * light.radius_m - beside * beside);
}

LightSample sample_sphere(const set::Light& light, const glm::dvec3& receiver, Random& random) {
  const auto view = view_sphere(light, receiver);
  if (!view) return {};
  const glm::dvec3 direction = sample_cone(view->axis, view->one_minus_cos, random.uniform2());
  const double distance =
      meet_sphere(light, {receiver, direction}).value_or(view->distance);  // the very rim
  const double pdf = 1 / (2 * pi * view->one_minus_cos);
  return {direction, distance, light.emission / pdf, pdf};
}

}  // namespace

LightSample sample_lamp(const set::Light& light, const glm::dvec3& receiver, Random& random) {
  switch (light.type) {
    case set::LightType::point:
    case set::LightType::spot:
      return sample_point(light, receiver);
    case set::LightType::directional:
      return sample_directional(light, random);
    case set::LightType::rectangle:
      return sample_rectangle(light, receiver, random);
    case set::LightType::sphere:
      return sample_sphere(light, receiver, random);
  }
  return {};
}

std::optional<LampHit> meet_lamp(const set::Light& light, const Ray& ray) {
  switch (light.type) {
    case set::LightType::point:
    case set::LightType::spot:
      return std::nullopt;
    case set::LightType::directional: {
      const double one_minus_cos = cone_one_minus_cos(light.angular_radius_rad);
      const glm::dvec3 aside = ray.direction + light.direction;
      if (light.angular_radius_rad <= 0 || 0.5 * glm::dot(aside, aside) > one_minus_cos) {
        return std::nullopt;
      }
      const double sine = std::sin(light.angular_radius_rad);
      return LampHit{infinity, light.emission / (pi * sine * sine), 1 / (2 * pi * one_minus_cos)};
    }
    case set::LightType::rectangle: {
      const double cosine = -glm::dot(ray.direction, light.direction);
      if (cosine <= 0) return std::nullopt;
      const double distance = glm::dot(ray.origin - light.position, light.direction) / cosine;
      if (distance <= 0) return std::nullopt;
      const glm::dvec3 p = ray.origin + distance * ray.direction - light.position;
      const auto [width, height] = rectangle_axes(light);
      if (std::abs(glm::dot(p, width)) > 0.5 * glm::dot(width, width) ||
          std::abs(glm::dot(p, height)) > 0.5 * glm::dot(height, height)) {
        return std::nullopt;
      }
      return LampHit{distance, light.emission,
                     distance * distance / (cosine * light.width_m * light.height_m)};
    }
    case set::LightType::sphere: {
      const auto view = view_sphere(light, ray.origin);
      const auto distance = meet_sphere(light, ray);
      if (!view || !distance) return std::nullopt;
      return LampHit{*distance, light.emission, 1 / (2 * pi * view->one_minus_cos)};
    }
  }
  return std::nullopt;
}

EmissiveMeshes::EmissiveMeshes(const scene::Scene& scene, const Geometry& geometry,
                               std::uint32_t world)
    : geometry_(geometry), first_entry_(scene.instances.size(), -1) {
  double sum = 0;
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const scene::Instance& instance = scene.instances[i];
    const double power = luminance(scene.materials[instance.material].emission);
    if (power <= 0 || !(instance.presence & world)) continue;
    first_entry_[i] = static_cast<std::ptrdiff_t>(entries_.size());
    const auto triangles = static_cast<std::uint32_t>(scene.meshes[instance.mesh].triangles.size());
    for (std::uint32_t t = 0; t < triangles; ++t) {
      const Triangle corners = geometry.triangle(i, t);
      const double area =
          0.5 * glm::length(glm::cross(corners.v1 - corners.v0, corners.v2 - corners.v0));
      entries_.push_back({i, t, area});
      cumulative_.push_back(sum += std::isfinite(area) ? area * power : 0);
    }
  }
  for (double& value : cumulative_) value /= sum;
}

EmissiveMeshes::Sample EmissiveMeshes::sample(Random& random) const {
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), random.uniform());
  const auto index = std::min<std::size_t>(static_cast<std::size_t>(found - cumulative_.begin()),
                                           cumulative_.size() - 1);
  const Entry& entry = entries_[index];
  glm::dvec2 u = random.uniform2();
  if (u.x + u.y > 1) u = 1.0 - u;
  const Triangle t = geometry_.triangle(entry.instance, entry.triangle);
  Sample s;
  s.instance = entry.instance;
  s.triangle = entry.triangle;
  s.position = (1 - u.x - u.y) * t.v0 + u.x * t.v1 + u.y * t.v2;
  s.normal = glm::normalize(glm::cross(t.v1 - t.v0, t.v2 - t.v0));
  s.weights = {1 - u.x - u.y, u.x, u.y};
  s.area_pdf = area_pdf(entry.instance, entry.triangle);
  return s;
}

double EmissiveMeshes::area_pdf(std::uint32_t instance, std::uint32_t triangle) const {
  if (first_entry_[instance] < 0) return 0;
  const auto index = static_cast<std::size_t>(first_entry_[instance]) + triangle;
  const double share = cumulative_[index] - (index == 0 ? 0 : cumulative_[index - 1]);
  return entries_[index].area > 0 ? share / entries_[index].area : 0;
}

}  // namespace previz::truth
