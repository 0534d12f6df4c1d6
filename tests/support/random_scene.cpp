#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <random>

#include "shaders/lib/octahedral.h"
#include "tests/support/scenes.hpp"

namespace previz::test {
namespace {

using std::numbers::pi;

// std's distributions differ between libraries; the engine does not.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  float between(double low, double high) { return static_cast<float>(uniform(low, high)); }
  int below(int count) { return static_cast<int>(engine_() % static_cast<std::uint64_t>(count)); }
  glm::vec3 color(double low, double high) {
    const float r = between(low, high), g = between(low, high), b = between(low, high);
    return {r, g, b};
  }

 private:
  std::mt19937_64 engine_;
};

enum class Kind { diffuse, textured, plastic, rough_metal, smooth_metal, emissive };

std::uint32_t add_random_texture(scene::Scene& scene, Random& random) {
  scene::Texture texture;
  texture.name = "patches";
  texture.width = 4 + random.below(5);
  texture.height = 4 + random.below(5);
  for (int i = 0; i < texture.width * texture.height; ++i)
    texture.texels.emplace_back(random.color(0.05, 0.85), 1.0f);
  const scene::Wrap wraps[] = {scene::Wrap::repeat, scene::Wrap::clamp, scene::Wrap::mirror};
  texture.wrap_u = wraps[random.below(3)];
  texture.wrap_v = wraps[random.below(3)];
  texture.nearest = random.below(2) == 0;
  return add_texture(scene, std::move(texture));
}

std::uint32_t add_random_material(scene::Scene& scene, Random& random, Kind kind) {
  switch (kind) {
    case Kind::diffuse:
      return add_material(scene, diffuse(random.color(0.1, 0.85)));
    case Kind::textured: {
      scene::Material material = diffuse(random.color(0.7, 1));
      material.name = "textured";
      material.base_color_texture = add_random_texture(scene, random);
      return add_material(scene, std::move(material));
    }
    case Kind::plastic: {
      const glm::vec3 base_color = random.color(0.05, 0.8);
      return add_material(scene, plastic(base_color, random.between(0.1, 0.6)));
    }
    case Kind::rough_metal: {
      const glm::vec3 f0 = random.color(0.5, 0.95);
      return add_material(scene, metal(f0, random.between(0.15, 0.6)));
    }
    case Kind::smooth_metal:
      return add_material(scene, metal(random.color(0.5, 0.95), 0));
    case Kind::emissive:
      return add_material(scene, emitter(random.color(0.5, 4)));
  }
  return 0;
}

// A box or sphere that stays within 0.09 m of its cell's centre and sinks 2 mm into the table.
void add_random_object(scene::Scene& scene, Random& random, const glm::dvec2& cell, Kind kind,
                       std::uint32_t presence) {
  const std::uint32_t material = add_random_material(scene, random, kind);
  const double sink_m = 0.002;
  const double turn = random.uniform(0, 2 * pi);
  scene::Mesh mesh;
  double height_m = 0;
  if (random.below(2) == 0) {
    const double x = random.uniform(0.05, 0.12), y = random.uniform(0.05, 0.12);
    height_m = random.uniform(0.04, 0.2);
    mesh = box_mesh({x, y, height_m});
  } else {
    const double radius_m = random.uniform(0.03, 0.08);
    height_m = 2 * radius_m;
    mesh = random.below(2) == 0 ? uv_sphere_mesh(radius_m, 48, 24) : icosphere_mesh(radius_m, 3);
    if (mesh.uvs.empty() && kind == Kind::textured) mesh = uv_sphere_mesh(radius_m, 48, 24);
  }
  const glm::dmat4 place = at(glm::dvec3(cell, 0.5 * height_m - sink_m));
  add(scene, std::move(mesh), material, glm::rotate(place, turn, glm::dvec3(0, 0, 1)), presence);
}

void add_objects(scene::Scene& scene, Random& random, std::uint32_t seed,
                 const RandomScene& options) {
  const double pitch_m = 0.22;  // cells do not overlap: 0.09 + 0.09 < 0.22
  std::vector<glm::dvec2> cells;
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) cells.emplace_back(pitch_m * (x - 1.5), pitch_m * (y - 1.5));
  for (std::size_t i = cells.size() - 1; i > 0; --i)
    std::swap(cells[i], cells[static_cast<std::size_t>(random.below(static_cast<int>(i) + 1))]);

  std::size_t cell = 0;
  for (int i = 0; i < options.real_objects && cell < cells.size(); ++i)
    add_random_object(scene, random, cells[cell++], static_cast<Kind>(random.below(3)),
                      scene::world_both);
  for (int i = 0; i < options.virtual_objects && cell < cells.size(); ++i) {
    const int kind = i == 0 ? static_cast<int>(seed % 6) : random.below(6);
    add_random_object(scene, random, cells[cell++], static_cast<Kind>(kind), scene::world_mixed);
  }
  for (int i = 0; i < options.removed_objects && cell < cells.size(); ++i)
    add_random_object(scene, random, cells[cell++], static_cast<Kind>(random.below(3)),
                      scene::world_real);
}

set::Light random_light(Random& random) {
  const set::LightType types[] = {set::LightType::point, set::LightType::spot,
                                  set::LightType::directional, set::LightType::rectangle,
                                  set::LightType::sphere};
  set::Light light;
  light.name = "random";
  light.type = types[random.below(5)];
  const double azimuth = random.uniform(0, 2 * pi), distance_m = random.uniform(0.2, 0.8);
  light.position = {distance_m * std::cos(azimuth), distance_m * std::sin(azimuth),
                    random.uniform(0.5, 1.2)};
  light.direction = glm::normalize(-light.position);
  light.up = std::abs(light.direction.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
  light.emission = glm::dvec3(random.color(0.5, 1.5));
  if (light.type == set::LightType::rectangle || light.type == set::LightType::sphere)
    light.emission *= 10.0;
  light.width_m = random.uniform(0.1, 0.4);
  light.height_m = random.uniform(0.1, 0.4);
  light.radius_m = random.uniform(0.02, 0.1);
  light.angular_radius_rad = random.below(2) == 0 ? 0.0 : random.uniform(0.01, 0.1);
  light.outer_cone_rad = random.uniform(0.4, 0.8);
  light.inner_cone_rad = random.uniform(0.1, 0.9) * light.outer_cone_rad;
  const double gains[][2] = {{1, 0}, {1, 1}, {0.3, 1}};  // added, real, dimmed
  const auto& gain = gains[random.below(3)];
  light.gain_mixed = gain[0];
  light.gain_real = gain[1];
  return light;
}

lighting::EnvironmentMap random_environment(Random& random, int size) {
  struct Lamp {
    glm::vec3 direction, radiance;
    float cos_radius;
  };
  const glm::vec3 sky = random.color(0.3, 0.8), ground = random.color(0.05, 0.3);
  const double tilt = random.uniform(0, 2 * pi);
  const glm::vec3 side(std::cos(tilt), std::sin(tilt), 0);
  const float sideways = random.between(0, 0.5);
  std::vector<Lamp> lamps(static_cast<std::size_t>(1 + random.below(3)));
  for (Lamp& lamp : lamps) {
    const double azimuth = random.uniform(0, 2 * pi), elevation = random.uniform(0.4, 1.4);
    lamp.direction = {std::cos(elevation) * std::cos(azimuth),
                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
    const float strength = random.between(20, 60);
    lamp.radiance = strength * 0.4f * random.color(0.7, 1);
    lamp.cos_radius = std::cos(random.between(0.06, 0.15));
  }
  const auto radiance_at = [&](const glm::vec3& direction) {
    const float up = 0.5f + 0.5f * direction.z;
    glm::vec3 radiance =
        (ground + (sky - ground) * up) * (1 + sideways * glm::dot(direction, side));
    for (const Lamp& lamp : lamps)
      if (glm::dot(direction, lamp.direction) > lamp.cos_radius) radiance += lamp.radiance;
    return radiance;
  };

  lighting::EnvironmentMap map{size, {}};
  const int steps = 4;  // a side, within a texel
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) {
      glm::vec3 sum(0);
      for (int step = 0; step < steps * steps; ++step) {
        const glm::ivec2 cell(step % steps, step / steps);
        const glm::vec2 within = (glm::vec2(cell) + 0.5f) / static_cast<float>(steps);
        const glm::vec2 point = 2.0f * (glm::vec2(i, j) + within) / static_cast<float>(size) - 1.0f;
        sum += radiance_at(octahedral_direction(point));
      }
      map.radiance.push_back(sum / static_cast<float>(steps * steps));
    }
  }
  return map;
}

}  // namespace

View random_scene(std::uint32_t seed, const RandomScene& options) {
  Random random(seed);
  View view;
  const std::uint32_t table_material = add_random_material(
      view.scene, random, random.below(2) == 0 ? Kind::diffuse : Kind::textured);
  add(view.scene, box_mesh({1.4, 1.2, 0.03}), table_material, at({0, 0, -0.015}));
  add_objects(view.scene, random, seed, options);
  for (int i = 0; i < options.lights; ++i) view.scene.lights.push_back(random_light(random));
  Random tints(seed + 1);  // numbers of their own, so that the rest of the view stays as it is
  if (options.tinted)
    for (set::Light& light : view.scene.lights) light.tint = glm::dvec3(tints.color(0.2, 1.6));
  view.environment = random_environment(random, options.environment_size);

  const double azimuth = random.uniform(0, 2 * pi);
  const double elevation = random.uniform(25, 55) * pi / 180;
  const double distance_m = random.uniform(1.2, 1.8);
  const glm::dvec3 eye =
      distance_m * glm::dvec3(std::cos(elevation) * std::cos(azimuth),
                              std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  const double x = random.uniform(-0.1, 0.1), y = random.uniform(-0.1, 0.1);
  view.world_from_camera = look_at(eye, {x, y, 0.05});
  view.calibration = pinhole(options.width, options.height, random.uniform(0.7, 1.0));
  if (options.lens) view.calibration.lens = ThinLens{0.05, random.uniform(1.4, 4), distance_m};
  return view;
}

}  // namespace previz::test
