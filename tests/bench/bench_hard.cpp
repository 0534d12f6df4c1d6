// Live frames of four scenes that are hard for a renderer, each beside the same work without what
// is hard: photons that all land in one place, a light frame with every camera's frame, one of many
// instances that moves, and a mesh whose every triangle emits light.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "drivers/plate.hpp"
#include "tests/bench/live_in_turns.hpp"
#include "tests/bench/program.hpp"
#include "tests/bench/view_from_above.hpp"
#include "tests/support/lighting_pictures.hpp"

namespace previz::bench {
namespace {

struct Options {
  int frames = 5;
  std::vector<std::string> only;
};

constexpr int width = 320, height = 240;
constexpr int photons = 200'000;
constexpr int instances_a_side = 100;    // 10,000 in all
constexpr int cells_of_lamp = 224;       // a side; each is two triangles, 100,352 in all
constexpr int light_camera_width = 640;  // pixels

using DevicePtr = std::shared_ptr<render::Device>;

LiveScene make_live(std::string name, const DevicePtr& device, const scene::Scene& scene,
                    const set::Estimation& estimation = {}) {
  ViewFromAbove view(device, scene, width, height, estimation);
  view.frame.plate = std::make_shared<const Plate>(
      Plate{width, height, 8, std::vector<std::uint16_t>(std::size_t{3} * width * height, 100)});
  view.frame.accumulates = true;
  view.frame.dithers = true;
  return {std::move(name), std::move(view.renderer), std::move(view.frame)};
}

std::uint32_t add_material(scene::Scene& scene, const scene::Material& material) {
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

// Adds a virtual object of a mesh of its own.
scene::Instance& add_virtual(scene::Scene& scene, scene::Mesh mesh,
                             const scene::Material& material) {
  scene::Instance instance;
  instance.name = "virtual";
  instance.mesh = static_cast<std::uint32_t>(scene.meshes.size());
  instance.material = add_material(scene, material);
  instance.presence = scene::world_mixed;
  scene.meshes.push_back(std::move(mesh));
  scene.instances.push_back(instance);
  return scene.instances.back();
}

void add_lamp(scene::Scene& scene, const set::Light& lamp) {
  scene.lights.push_back(lamp);
  scene.light_objects.push_back(scene::no_object);
}

void compare(std::vector<LiveScene> scenes, const char* title, int frames) {
  std::printf("%s\n\n", title);
  print_live(scenes, live_in_turns(scenes, frames));
}

enum class Mirror { hollow, convex };

// A round mirror that looks up from z = 0, cut from a sphere of this radius, whose centre is above
// it where it is hollow.
scene::Mesh mirror(Mirror kind, float sphere_radius) {
  constexpr float rim_radius = 0.5f;
  const float side = kind == Mirror::hollow ? 1.0f : -1.0f;
  scene::Mesh mesh = grid(2, 64);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    glm::vec3& p = mesh.positions[i];
    const float to_edge = std::max(std::abs(p.x), std::abs(p.y));
    if (to_edge > 0) p *= rim_radius * to_edge / glm::length(p);
    p.z = side * (sphere_radius - std::sqrt(sphere_radius * sphere_radius - p.x * p.x - p.y * p.y));
    mesh.normals[i] = side * glm::normalize(glm::vec3(0, 0, side * sphere_radius) - p);
  }
  return mesh;
}

// A lamp on the table shines on a mirror beside it, which throws the light back to the table: a
// hollow one into a spot of a centimetre, in the middle of a cell of the photons' grid; a convex
// one over six metres, where a cell holds some twenty of 200,000 photons.
scene::Scene mirror_over_table(Mirror kind) {
  constexpr double away = 2;
  const glm::dvec3 middle(0.027, 0, 0), to_lamp(0, 0.082, 0.02);
  scene::Scene scene = scene_of(grid(16, 8));
  scene::Material silver;
  silver.metallic = 1;
  silver.roughness = 0;
  const float sphere_radius = kind == Mirror::hollow ? away : 1;
  scene::Instance& instance = add_virtual(scene, mirror(kind, sphere_radius), silver);
  const glm::dmat4 aimed =
      glm::rotate(glm::dmat4(1), 0.75 * std::numbers::pi, glm::dvec3(0, -1, 0));
  const glm::dvec3 to_middle(aimed[2]);
  instance.world_from_object = glm::translate(glm::dmat4(1), middle - away * to_middle) * aimed;
  set::Light lamp;
  lamp.position = middle + to_lamp;
  lamp.emission = glm::dvec3(20);
  add_lamp(scene, lamp);
  return scene;
}

LiveScene live_photons(std::string name, const DevicePtr& device, Mirror mirror) {
  set::Estimation estimation;
  estimation.photons = static_cast<double>(photons) / (width * height);
  LiveScene live = make_live(std::move(name), device, mirror_over_table(mirror), estimation);
  // All photons come from the lamp.
  live.renderer->set_environment({1, {glm::vec3(0)}}, set::LightSampling::importance);
  return live;
}

// So many photons are in flight at once only where the device is treated as a graphics card.
void compare_focus(int frames) {
  render::DeviceOptions wanted;
  wanted.as_gpu = true;
  wanted.times_passes = true;
  const auto device = render::open_device(wanted);
  std::vector<LiveScene> scenes;
  scenes.push_back(live_photons("spread", device, Mirror::convex));
  scenes.push_back(live_photons("in one spot", device, Mirror::hollow));
  compare(std::move(scenes), "200,000 photons", frames);
}

scene::Scene object_on_table() {
  scene::Scene scene = scene_of(grid(4, 8));
  add_virtual(scene, bumpy_sphere(5, 0.5, 0.2, 7), {});
  return scene;
}

// The light camera's picture of a sky; its timestamps rise from round to round.
FramePtr light_frame(const LightCameraCalibration& camera, int round) {
  const auto sky = [](const glm::dvec3& d) {
    return glm::dvec3(0.2, 0.3, 0.5) * std::max(d.z, 0.1);
  };
  static const FramePtr picture = test::photograph(camera, sky, 1);
  Frame frame = *picture;
  frame.sequence = static_cast<std::uint64_t>(round);
  frame.timestamp_ns = std::int64_t{33'000'000} * (round + 1);
  return std::make_shared<const Frame>(std::move(frame));
}

// A light frame on its way through the steps that a rig takes with it.
struct LightOnItsWay {
  LightOnItsWay() : estimator(camera, settings) {}

  LightCameraCalibration camera = test::fisheye_camera(light_camera_width);
  set::Lighting settings;
  lighting::Estimator estimator;
  FramePtr frame;
  lighting::Lighting light;
  render::EncodedEnvironment encoded;
};

LiveScene live_light(std::string name, const DevicePtr& device, bool is_new_each_frame) {
  const auto way = std::make_shared<LightOnItsWay>();
  LiveScene live = make_live(std::move(name), device, object_on_table());
  render::Renderer* renderer = live.renderer.get();
  const auto see = [way](int round) { way->frame = light_frame(way->camera, round); };
  const auto estimate = [way](int) { way->light = way->estimator(std::span(&way->frame, 1)); };
  const auto encode = [way](int) {
    way->encoded = render::encode_environment(way->light.environment);
  };
  const auto set = [way, renderer](int) {
    renderer->set_environment(way->encoded, set::LightSampling::importance);
  };
  if (is_new_each_frame) {
    live.steps = {{"copy of the light frame", see},
                  {"estimate of the light", estimate},
                  {"tables for sampling it", encode},
                  {"upload", set}};
    return live;
  }
  see(0);
  estimate(0);
  encode(0);
  set(0);
  std::printf("environment of %d texels a side, light frames of %d x %d pixels\n\n",
              way->light.environment.size, light_camera_width, light_camera_width);
  return live;
}

void compare_light(const DevicePtr& device, int frames) {
  std::vector<LiveScene> scenes;
  scenes.push_back(live_light("one light", device, false));
  scenes.push_back(live_light("one with every frame", device, true));
  compare(std::move(scenes), "A light frame with every frame", frames);
}

// A square of so many virtual spheres a side on the table, all of one mesh.
scene::Scene spheres_on_table(int a_side) {
  scene::Scene scene = scene_of(grid(4, 8));
  const double spacing = 2.0 / a_side;
  add_virtual(scene, bumpy_sphere(2, 0.4, 0.2, 7), {});
  const scene::Instance sphere = scene.instances.back();
  scene.instances.pop_back();
  for (int i = 0; i < a_side * a_side; ++i) {
    scene::Instance& placed = scene.instances.emplace_back(sphere);
    const int column = i % a_side, row = i / a_side;
    const glm::dvec3 at((column + 0.5) * spacing - 1, (row + 0.5) * spacing - 1, 0.5 * spacing);
    placed.world_from_object = glm::scale(glm::translate(glm::dmat4(1), at), glm::dvec3(spacing));
  }
  return scene;
}

// Moves the last instance, as a rig does before every frame.
Step move_of_last(render::Renderer& renderer, const scene::Scene& scene, double by_m) {
  return {"move", [&renderer, by_m, instances = scene.instances, lights = scene.lights](int round) {
            std::vector<scene::Instance> moved = instances;
            moved.back().world_from_object[3].z += by_m * (round + 1);
            renderer.move(moved, lights);
          }};
}

LiveScene live_spheres(std::string name, const DevicePtr& device, int a_side, double moves_by_m) {
  const scene::Scene scene = spheres_on_table(a_side);
  LiveScene live = make_live(std::move(name), device, scene);
  if (moves_by_m > 0) live.steps = {move_of_last(*live.renderer, scene, moves_by_m)};
  return live;
}

void compare_instances(const DevicePtr& device, int frames) {
  constexpr double step_m = 0.005;
  std::vector<LiveScene> scenes;
  scenes.push_back(live_spheres("100, still", device, 10, 0));
  scenes.push_back(live_spheres("100, one moves", device, 10, step_m));
  scenes.push_back(live_spheres("10,000, still", device, instances_a_side, 0));
  scenes.push_back(live_spheres("10,000, one moves", device, instances_a_side, step_m));
  compare(std::move(scenes), "10,000 instances", frames);
}

// A wavy sheet over the table.
scene::Mesh sheet() {
  scene::Mesh mesh = grid(1, cells_of_lamp);
  for (glm::vec3& p : mesh.positions) p.z = 0.05f * std::sin(20 * p.x) * std::sin(20 * p.y);
  return mesh;
}

scene::Scene sheet_over_table(bool emits) {
  scene::Scene scene = scene_of(grid(4, 8));
  scene::Material material;
  if (emits) material.emission = glm::vec3(2);
  scene::Instance& instance = add_virtual(scene, sheet(), material);
  instance.world_from_object = glm::translate(glm::dmat4(1), glm::dvec3(0, 0, 0.5));
  for (int i = 0; i < 4 && !emits; ++i) {
    set::Light lamp;
    lamp.type = set::LightType::rectangle;
    const int column = i % 2, row = i / 2;
    lamp.position = {column - 0.5, row - 0.5, 0.4};
    lamp.width_m = lamp.height_m = 0.5;
    lamp.emission = glm::dvec3(2);
    add_lamp(scene, lamp);
  }
  return scene;
}

void compare_emitters(const DevicePtr& device, int frames) {
  const scene::Scene glowing = sheet_over_table(true);
  std::vector<LiveScene> scenes;
  scenes.push_back(make_live("four lamps", device, sheet_over_table(false)));
  scenes.push_back(make_live("the mesh emits", device, glowing));
  scenes.push_back(make_live("it emits and moves", device, glowing));
  scenes.back().steps = {move_of_last(*scenes.back().renderer, glowing, 0.005)};
  compare(std::move(scenes), "100,352 triangles", frames);
}

void run(const Options& options) {
  render::DeviceOptions wanted;
  wanted.times_passes = true;
  const auto device = render::open_device(wanted);
  std::printf("%s, %dx%d, 1 sample, medians of %d frames\n\n", render::device_name(*device).c_str(),
              width, height, options.frames);
  const auto is_wanted = [&](const char* name) {
    return options.only.empty() || std::ranges::find(options.only, name) != options.only.end();
  };
  if (is_wanted("focus")) compare_focus(options.frames);
  if (is_wanted("light")) compare_light(device, options.frames);
  if (is_wanted("instances")) compare_instances(device, options.frames);
  if (is_wanted("emitters")) compare_emitters(device, options.frames);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Live frames of scenes that are hard for a renderer, beside easier ones");
  app.add_option("--frames", options.frames, "measured of each scene")->check(CLI::Range(1, 1000));
  app.add_option("--only", options.only, "Scenes that are measured; all unless stated")
      ->check(CLI::IsMember({"focus", "light", "instances", "emitters"}));
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
