#include "daemon/core/pipeline/lamp_claims.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>
#include <numbers>
#include <utility>

#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

using lighting::Claim;
using std::numbers::pi;

constexpr std::array<glm::uvec3, 12> box_sides = {{{0, 1, 3},
                                                   {0, 3, 2},
                                                   {4, 5, 7},
                                                   {4, 7, 6},
                                                   {0, 1, 5},
                                                   {0, 5, 4},
                                                   {2, 3, 7},
                                                   {2, 7, 6},
                                                   {0, 2, 6},
                                                   {0, 6, 4},
                                                   {1, 3, 7},
                                                   {1, 7, 5}}};

struct Box {
  glm::dvec3 least, most;
};

Box box_around(const scene::Mesh& mesh) {
  Box box{glm::dvec3(mesh.positions.front()), glm::dvec3(mesh.positions.front())};
  for (const glm::vec3& position : mesh.positions) {
    box.least = glm::min(box.least, glm::dvec3(position));
    box.most = glm::max(box.most, glm::dvec3(position));
  }
  return box;
}

bool is_around(const Box& box, const scene::Instance& instance, const glm::dvec3& place) {
  const glm::dvec3 at(glm::inverse(instance.world_from_object) * glm::dvec4(place, 1));
  return glm::all(glm::greaterThanEqual(at, box.least)) &&
         glm::all(glm::lessThanEqual(at, box.most));
}

std::vector<glm::dvec3> box_outline(const scene::Instance& instance, const Box& box,
                                    const glm::dvec3& seen_from) {
  const auto& [least, most] = box;
  std::array<glm::dvec3, 8> corners;
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 corner((i & 1) != 0 ? most.x : least.x, (i & 2) != 0 ? most.y : least.y,
                            (i & 4) != 0 ? most.z : least.z);
    corners[static_cast<std::size_t>(i)] =
        glm::dvec3(instance.world_from_object * glm::dvec4(corner, 1)) - seen_from;
  }
  std::vector<glm::dvec3> outline;
  for (const glm::uvec3& side : box_sides)
    for (int k = 0; k < 3; ++k) outline.push_back(corners[side[k]]);
  return outline;
}

// Returns the corners of a rectangle's two triangles.
std::array<glm::dvec3, 6> rectangle_corners(const set::Light& light) {
  const glm::dvec3 across = glm::cross(light.up, light.direction) * (light.width_m / 2);
  const glm::dvec3 up = light.up * (light.height_m / 2);
  const glm::dvec3 a = light.position - across - up, b = light.position + across - up;
  const glm::dvec3 c = light.position + across + up, d = light.position - across + up;
  return {a, b, c, a, c, d};
}

// Returns the solid angle of a triangle (van Oosterom and Strackee 1983, equation 8).
double triangle_sr(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
  a = glm::normalize(a), b = glm::normalize(b), c = glm::normalize(c);
  const double volume = std::abs(glm::dot(a, glm::cross(b, c)));
  return 2 * std::atan2(volume, 1 + glm::dot(a, b) + glm::dot(b, c) + glm::dot(c, a));
}

double sphere_radius_rad(const set::Light& light, const glm::dvec3& seen_from) {
  const double distance = glm::length(light.position - seen_from);
  return distance > light.radius_m ? std::asin(light.radius_m / distance) : pi / 2;
}

double cap_sr(double radius_rad) {
  const double half = std::sin(radius_rad / 2);
  return 4 * pi * half * half;
}

Claim claim_of(const set::Light& light, const glm::dvec3& seen_from) {
  using enum set::LightType;
  Claim claim;
  claim.lamp = light.name;
  const bool is_distant = light.type == directional;
  const glm::dvec3 to_lamp = is_distant ? -light.direction : light.position - seen_from;
  claim.centre = glm::length(to_lamp) > 0 ? glm::normalize(to_lamp) : glm::dvec3(0, 0, 1);
  claim.cone_rad = light.cone_rad;
  if (light.cone_rad > 0) return claim;
  if (light.type == rectangle)
    for (const glm::dvec3& corner : rectangle_corners(light))
      claim.outline.push_back(corner - seen_from);
  // A lamp without extent gets the margin alone, which a sphere and a disc get too.
  else
    claim.cone_rad =
        lighting::outline_margin_rad + (light.type == sphere ? sphere_radius_rad(light, seen_from)
                                        : is_distant         ? light.angular_radius_rad
                                                             : 0);
  claim.has_size = light.type == rectangle || light.type == sphere ||
                   (is_distant && light.angular_radius_rad > 0);
  return claim;
}

void add_trouble(const set::Object& object, const char* why, LampClaims& result) {
  std::string what =
      "the light of \"" + object.name + "\" is not subtracted from the environment light: " + why;
  if (std::ranges::find(result.troubles, what) == result.troubles.end())
    result.troubles.push_back(std::move(what));
}

// Returns whether a real object that shines moves, and so cannot be taken out where it is; one that
// an animation moves is noted.
bool moves(const set::Object& object, LampClaims& result) {
  if (!object.animation.empty()) add_trouble(object, "an animation moves it", result);
  return !object.carrier.empty() || !object.animation.empty();
}

void claim_glowing_objects(const set::Set& set, const scene::Scene& scene,
                           const glm::dvec3& seen_from, LampClaims& result) {
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const std::uint32_t object = scene.light_objects[i];
    if (object == scene::no_object || scene.lights[i].gain_real == 0 ||
        moves(set.objects[object], result))
      continue;
    result.claims.push_back(claim_of(scene.lights[i], seen_from));
    result.claims.back().lamp = set.objects[object].name;
    result.lights.push_back(no_light);
  }
  for (const scene::Instance& instance : scene.instances) {
    const set::Object& object = set.objects[instance.object];
    const bool is_real = (instance.presence & scene::world_real) != 0;
    if (!is_real || !scene::emits(scene.materials[instance.material]) || moves(object, result))
      continue;
    const Box box = box_around(scene.meshes[instance.mesh]);
    if (is_around(box, instance, seen_from)) {
      add_trouble(object, "it encloses the light camera", result);
      continue;
    }
    Claim claim;
    claim.lamp = object.name;
    claim.outline = box_outline(instance, box, seen_from);
    glm::dvec3 middle(0);
    for (const glm::dvec3& corner : claim.outline)
      middle += corner / static_cast<double>(claim.outline.size());
    claim.centre = glm::length(middle) > 0 ? glm::normalize(middle) : glm::dvec3(0, 0, 1);
    result.claims.push_back(std::move(claim));
    result.lights.push_back(no_light);
  }
}

}  // namespace

LampClaims claims_of(const set::Set& set, const scene::Scene* scene, const glm::dvec3& seen_from) {
  LampClaims result;
  for (const set::CapturedLamp& lamp : set.captured_lamps) {
    const glm::dvec3 to_lamp = lamp.position ? *lamp.position - seen_from : lamp.direction;
    if (glm::length(to_lamp) == 0)
      throw Error(set.file.string() + ": captured_light \"" + lamp.name +
                  "\": position_m is the light camera's own");
    result.claims.push_back({lamp.name, glm::normalize(to_lamp), lamp.cone_rad, {}});
  }
  for (std::size_t i = 0; i < set.lights.size(); ++i) {
    if (!set.lights[i].captured) continue;
    result.claims.push_back(claim_of(set.lights[i], seen_from));
    result.lights.push_back(i);
  }
  if (scene && !set.lighting.environment) claim_glowing_objects(set, *scene, seen_from, result);
  return result;
}

std::optional<glm::dvec3> emission_for(const set::Light& light, const glm::dvec3& flux,
                                       const glm::dvec3& seen_from) {
  using enum set::LightType;
  const glm::dvec3 to_place = seen_from - light.position;
  const double distance = glm::length(to_place);
  switch (light.type) {
    case point:
      return flux * (distance * distance);
    case spot: {
      const double cosine = distance > 0 ? glm::dot(to_place, light.direction) / distance : 1;
      const double inner = std::cos(light.inner_cone_rad), outer = std::cos(light.outer_cone_rad);
      if (!(cosine > outer)) return std::nullopt;
      const double x = inner > outer ? std::clamp((cosine - outer) / (inner - outer), 0.0, 1.0) : 1;
      const double falloff = x * x * (3 - 2 * x);  // spot_falloff of shaders/lib/light.glsl
      return falloff > 0 ? std::optional(flux * (distance * distance / falloff)) : std::nullopt;
    }
    case directional: {
      const double radius = light.angular_radius_rad, sine = std::sin(radius);
      return radius > 0 ? flux * (pi * sine * sine / cap_sr(radius)) : flux;
    }
    case rectangle: {
      if (!(glm::dot(to_place, light.direction) > 0)) return std::nullopt;
      const auto corners = rectangle_corners(light);
      double solid_angle = 0;
      for (std::size_t i = 0; i < corners.size(); i += 3)
        solid_angle += triangle_sr(corners[i] - seen_from, corners[i + 1] - seen_from,
                                   corners[i + 2] - seen_from);
      return solid_angle > 0 ? std::optional(flux / solid_angle) : std::nullopt;
    }
    case sphere:
      return flux / cap_sr(sphere_radius_rad(light, seen_from));
  }
  return std::nullopt;
}

}  // namespace previz::pipeline
