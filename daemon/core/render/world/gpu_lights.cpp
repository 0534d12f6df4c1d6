#include "daemon/core/render/world/gpu_lights.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace previz::render {
namespace {

constexpr double pi = std::numbers::pi;

// A disc narrower than this counts as one direction: neighbouring directions in single precision
// are 1e-7 apart.
constexpr double least_disc_rad = 1e-6;

// This share of the light samples is divided evenly, so that no light, however faint beside
// another, is left to luck.
constexpr double even_share = 0.1;

// This share of the samples of lamps in the tree is taken by power. The tree does not know what
// stands in the light: the lamps that it favours may be hidden.
constexpr double rest_of_tree = 0.1;

std::uint32_t gpu_type(set::LightType type) {
  switch (type) {
    case set::LightType::point:
      return gpu::LIGHT_POINT;
    case set::LightType::spot:
      return gpu::LIGHT_SPOT;
    case set::LightType::directional:
      return gpu::LIGHT_DIRECTIONAL;
    case set::LightType::rectangle:
      return gpu::LIGHT_RECTANGLE;
    case set::LightType::sphere:
      return gpu::LIGHT_SPHERE;
  }
  return gpu::LIGHT_POINT;
}

// The emission is that of the world and the channel in which the lamp's gain is largest, so that
// what changes in a single channel is sampled, too.
double emitted(const gpu::GpuLight& light) {
  const double emission = (light.emission.r + light.emission.g + light.emission.b) / 3.0;
  const glm::vec3 gains = glm::max(light.gain_mixed, light.gain_real);
  return std::max({gains.r, gains.g, gains.b}) * emission;
}

// Returns the solid angle over 2 pi of a light that faces the scene from a distance of one scene
// radius. A point counts as a disc as wide as one direction in single precision.
double solid_angle(const gpu::GpuLight& light, double scene_radius) {
  const double area = glm::length(glm::cross(glm::dvec3(light.edge_u), glm::dvec3(light.edge_v)));
  const double least = least_disc_rad * least_disc_rad / 2;
  const double squared = scene_radius * scene_radius;
  double result = least;
  if (light.type == gpu::LIGHT_DIRECTIONAL) result = light.cone_sr / (2 * pi);
  if (light.type == gpu::LIGHT_RECTANGLE) result = area / squared / (2 * pi);
  if (light.type == gpu::LIGHT_TRIANGLE) result = area / 2 / squared / (2 * pi);
  if (light.type == gpu::LIGHT_SPHERE) result = light.radius * light.radius / squared / 2;
  return std::clamp(result, least, 2.0);
}

bool has_disc(const set::Light& light) {
  return light.type == set::LightType::directional && light.angular_radius_rad > least_disc_rad;
}

}  // namespace

bool can_be_seen(const set::Light& light) {
  return light.type == set::LightType::rectangle || light.type == set::LightType::sphere ||
         has_disc(light);
}

bool are_many(const scene::Scene& scene) {
  std::vector<bool> glows;
  for (const scene::Instance& instance : scene.instances)
    glows.push_back(scene::emits(scene.materials[instance.material]));
  for (const scene::Variants& variants : scene.variants)
    for (const scene::Variants::Part& part : variants.parts)
      for (const scene::Variants::Look& look : part.looks)
        if (scene::emits(scene.materials[look.material])) glows[part.instance] = true;
  std::size_t count = scene.lights.size();
  for (std::size_t i = 0; i < glows.size(); ++i)
    if (glows[i]) count += scene.meshes[scene.instances[i].mesh].triangles.size();
  return count > gpu::FEW_LIGHTS;
}

void append_lamp(PlacedLights& to, const set::Light& light) {
  gpu::GpuLight result{};
  result.type = gpu_type(light.type);
  result.direction = glm::vec3(glm::normalize(light.direction));
  result.emission = glm::vec3(light.emission);
  result.gain_mixed = glm::vec3(light.gain_mixed * light.tint);
  result.gain_real = glm::vec3(static_cast<float>(light.gain_real));
  result.radius = static_cast<float>(light.radius_m);
  result.emission_texture = gpu::NO_INDEX;
  result.alpha_instance = gpu::NO_INDEX;
  if (light.type == set::LightType::spot) {
    result.cos_inner = static_cast<float>(std::cos(light.inner_cone_rad));
    result.cos_outer = static_cast<float>(std::cos(light.outer_cone_rad));
  }
  if (light.type == set::LightType::rectangle) {
    const glm::dvec3 normal = glm::normalize(light.direction);
    const glm::dvec3 up = glm::normalize(light.up - glm::dot(light.up, normal) * normal);
    result.edge_u = glm::vec3(glm::cross(up, normal) * light.width_m);
    result.edge_v = glm::vec3(up * light.height_m);
  }
  if (has_disc(light)) {
    const double sine = std::sin(light.angular_radius_rad);
    const double half = std::sin(light.angular_radius_rad / 2);
    result.cone_sr = static_cast<float>(4 * pi * half * half);
    // This is the disc's radiance that gives the stated irradiance on a plane facing it.
    result.emission = glm::vec3(light.emission / (pi * sine * sine));
  }
  to.lights.push_back(result);
  to.positions.push_back(light.position);
  to.weights.values.push_back(1);
}

void append_emitter(PlacedLights& to, const scene::Scene& scene, std::uint32_t index,
                    const scene::Instance& instance, const std::vector<double>& weights) {
  const scene::Mesh& mesh = scene.meshes[instance.mesh];
  const scene::Material& material = scene.materials[instance.material];
  const auto world = [&](std::uint32_t vertex) {
    const glm::dvec4 p(glm::dvec3(mesh.positions[vertex]), 1.0);
    return glm::dvec3(instance.world_from_object * p);
  };
  std::vector<double>& all_weights = to.weights.values;
  if (weights.empty())
    all_weights.insert(all_weights.end(), mesh.triangles.size(), 1);
  else
    all_weights.insert(all_weights.end(), weights.begin(), weights.end());
  const std::vector<glm::vec2>& uvs =
      scene::uvs_of(mesh, scene::mapping_of(material, &scene::Material::emission_texture));
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3& triangle = mesh.triangles[i];
    gpu::GpuLight light{};
    light.type = gpu::LIGHT_TRIANGLE;
    const glm::dvec3 v0 = world(triangle.x);
    const glm::dvec3 u = world(triangle.y) - v0;
    const glm::dvec3 v = world(triangle.z) - v0;
    const glm::dvec3 normal = glm::cross(u, v);
    const double doubled_area = glm::length(normal);
    light.edge_u = glm::vec3(u);
    light.edge_v = glm::vec3(v);
    light.direction =
        doubled_area > 0 ? glm::vec3(normal / doubled_area) : glm::vec3(0.0f, 0.0f, 1.0f);
    light.emission = material.emission;
    light.gain_mixed = glm::vec3((instance.presence & scene::world_mixed) != 0 ? 1 : 0);
    light.gain_real = glm::vec3((instance.presence & scene::world_real) != 0 ? 1 : 0);
    light.emission_texture = material.emission_texture;
    light.alpha_instance = material.alpha_mode == scene::AlphaMode::opaque ? gpu::NO_INDEX : index;
    light.alpha_primitive = i;
    if (!uvs.empty()) {
      light.uv0 = uvs[triangle.x];
      light.uv1 = uvs[triangle.y];
      light.uv2 = uvs[triangle.z];
    }
    to.lights.push_back(light);
    to.positions.push_back(v0);
  }
}

double power_of(const gpu::GpuLight& light, double scene_radius) {
  const double brightness = emitted(light);
  const double area = glm::length(glm::cross(glm::dvec3(light.edge_u), glm::dvec3(light.edge_v)));
  const double disc = pi * scene_radius * scene_radius;
  switch (light.type) {
    case gpu::LIGHT_POINT:
      return brightness * 4 * pi;
    case gpu::LIGHT_SPOT:
      return brightness * 2 * pi * (1 - light.cos_outer);
    case gpu::LIGHT_DIRECTIONAL:
      return brightness * disc * (light.cone_sr > 0 ? light.cone_sr : 1);
    case gpu::LIGHT_RECTANGLE:
      return brightness * pi * area;
    case gpu::LIGHT_SPHERE:
      return brightness * pi * 4 * pi * light.radius * light.radius;
    default:
      return brightness * pi * area;  // triangle: half the area, both sides
  }
}

double intensity(const gpu::GpuLight& light) {
  const double area = glm::length(glm::cross(glm::dvec3(light.edge_u), glm::dvec3(light.edge_v)));
  double seen = 1;
  if (light.type == gpu::LIGHT_RECTANGLE) seen = area;
  if (light.type == gpu::LIGHT_TRIANGLE) seen = area / 2;
  if (light.type == gpu::LIGHT_SPHERE) seen = pi * light.radius * light.radius;
  return emitted(light) * seen;
}

double select_by_power(std::vector<gpu::GpuLight>& lights, double scene_radius,
                       const Weights& weights) {
  std::vector<double> powers;
  powers.reserve(lights.size());
  double total = 0;
  std::size_t shining = 0;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const double watts = power_of(lights[i], scene_radius) * weights.of(i);
    powers.push_back(watts);
    if (!(watts > 0)) continue;  // black, or a triangle whose power is NaN
    total += watts;
    ++shining;
  }
  double sum = 0;
  float below = 0;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    gpu::GpuLight& light = lights[i];
    const double watts = powers[i];
    if (watts > 0)
      sum += (1 - even_share) * watts / total + even_share / static_cast<double>(shining);
    light.cdf = std::min(static_cast<float>(sum), 1.0f);
    // The probability is the rounded one that the shader picks by.
    light.selection = light.cdf - below;
    below = light.cdf;
  }
  return total;
}

float select_by_tree(std::vector<gpu::GpuLight>& lights) {
  const auto in_tree = [](const gpu::GpuLight& light) { return light.leaf != gpu::NO_INDEX; };
  double share = 0;
  for (const gpu::GpuLight& light : lights)
    if (in_tree(light)) share += (1 - rest_of_tree) * light.selection;
  if (std::ranges::count_if(lights, in_tree) < 2) share = 0;
  const auto tree_share = static_cast<float>(share);
  double sum = 0, total = 0;
  const auto rest = [&](const gpu::GpuLight& light) {
    return in_tree(light) && share > 0 ? rest_of_tree * light.selection : 1.0 * light.selection;
  };
  for (const gpu::GpuLight& light : lights) total += rest(light);
  float below = 0;
  for (gpu::GpuLight& light : lights) {
    sum += rest(light);
    light.rest_cdf = total > 0 ? std::min(static_cast<float>(sum / total), 1.0f) : 0.0f;
    light.rest_selection = (1 - tree_share) * (light.rest_cdf - below);
    below = light.rest_cdf;
  }
  return tree_share;
}

double spread_of(const std::vector<gpu::GpuLight>& lights, double scene_radius,
                 const Weights& weights) {
  double total = 0, information = 0;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const gpu::GpuLight& light = lights[i];
    const double watts = power_of(light, scene_radius) * weights.of(i);
    if (!(watts > 0)) continue;
    total += watts;
    information += watts * std::log(watts / solid_angle(light, scene_radius));
  }
  return total > 0 ? std::min(total * std::exp(-information / total), 2.0) : 2.0;
}

}  // namespace previz::render
