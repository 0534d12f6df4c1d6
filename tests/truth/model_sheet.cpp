// Draws glTF models of any origin side by side, each from the front right under a sky with a bright
// window: what previzd makes of a model is seen at once beside the picture that its author has of
// it. A model that is refused has the reason under it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>

#include "daemon/output/png.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/scene/load.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/octahedral.h"
#include "tests/support/scenes.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/comparison_sheet.hpp"

namespace previz::truth {
namespace {

using namespace previz::test;

constexpr int width = 240, height = 180;

// A sky that fades to a dark ground, and a window that is ten times as bright.
lighting::EnvironmentMap sky() {
  constexpr int size = 64;
  lighting::EnvironmentMap map{size, {}};
  const glm::vec3 window = glm::normalize(glm::vec3(-0.7f, -0.6f, 0.8f));
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      const glm::vec2 at = 2.0f * (glm::vec2(i, j) + 0.5f) / static_cast<float>(size) - 1.0f;
      const glm::vec3 direction = octahedral_direction(at);
      glm::vec3 radiance = glm::mix(glm::vec3(0.15f, 0.13f, 0.12f), glm::vec3(0.5f, 0.6f, 0.75f),
                                    glm::smoothstep(-0.3f, 0.6f, direction.z));
      if (glm::dot(direction, window) > 0.9f) radiance = glm::vec3(6, 5.6f, 5);
      map.radiance.push_back(radiance);
    }
  return map;
}

struct Bounds {
  glm::dvec3 low{1e300}, high{-1e300};
};

Bounds bounds_of(const scene::Scene& scene) {
  Bounds bounds;
  for (const scene::Instance& instance : scene.instances)
    for (const glm::vec3& p : scene.meshes[instance.mesh].positions) {
      const glm::dvec3 at(instance.world_from_object * glm::dvec4(glm::dvec3(p), 1));
      bounds.low = glm::min(bounds.low, at);
      bounds.high = glm::max(bounds.high, at);
    }
  return bounds;
}

// A floor of grey squares below the model, so that glass has something to show.
void add_floor(scene::Scene& scene, const Bounds& bounds, double radius) {
  scene::Texture squares;
  squares.width = squares.height = 16;
  squares.nearest = true;
  for (int i = 0; i < 256; ++i)
    squares.texels.emplace_back(glm::vec3((i + i / 16) % 2 == 0 ? 0.25f : 0.45f), 1.0f);
  scene::Material material = diffuse(glm::vec3(1));
  material.base_color_texture = add_texture(scene, squares);
  glm::dmat4 pose(1);
  const glm::dvec3 middle = 0.5 * (bounds.low + bounds.high);
  pose[3] = {middle.x, middle.y, bounds.low.z - 0.01 * radius, 1};
  add_instance(scene, add_mesh(scene, rectangle_mesh(glm::dvec2(8 * radius))),
               add_material(scene, material), pose);
}

View view_of(const std::filesystem::path& file, const std::string& animation) {
  set::Set set;
  set.objects.emplace_back();
  set.objects[0].file = file;
  set.objects[0].animation = animation;
  set.objects[0].presence = set::Presence::phantom;
  View view;
  view.scene = scene::load_scene(set);
  for (const std::string& note : view.scene.notes) std::printf("  %s\n", note.c_str());
  const Bounds bounds = bounds_of(view.scene);
  if (!(bounds.low.x <= bounds.high.x))
    throw Error(file.string() + ": nothing is to be seen in it");
  const glm::dvec3 middle = 0.5 * (bounds.low + bounds.high);
  const double radius = 0.5 * glm::length(bounds.high - bounds.low);
  add_floor(view.scene, bounds, radius);
  view.environment = sky();
  view.calibration = pinhole(width, height, 0.7);
  view.world_from_camera =
      look_at(middle + 3.2 * radius * glm::normalize(glm::dvec3(0.6, -1, 0.45)), middle);
  return view;
}

Panel panel_of(const std::shared_ptr<render::Device>& device, const std::string& file,
               const std::string& animation, int samples) {
  Panel panel{std::filesystem::path(file).stem().string(), {}};
  std::printf("%s\n", file.c_str());
  try {
    const View view = view_of(file, animation);
    render::Renderer renderer(device, {}, view.calibration);
    renderer.set_scene(view.scene);
    renderer.set_environment(view.environment, set::LightSampling::importance);
    renderer.begin({{}, 1.0, view.world_from_camera});
    renderer.render(samples);
    panel.picture =
        displayed(renderer.layers().mixed, width, height, 1.0, view.calibration.response);
  } catch (const Error& error) {
    std::printf("  refused: %s\n", error.what());
    panel.caption += ": refused";
    panel.picture = displayed(std::vector<glm::vec3>(std::size_t{width} * height), width, height,
                              1.0, pinhole(width, height, 0.7).response);
  }
  return panel;
}

int run(const std::string& picture, const std::vector<std::string>& files,
        const std::string& animation, int samples, std::size_t columns) {
  const auto device = render::open_device();
  std::vector<std::vector<Panel>> rows;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (i % columns == 0) rows.emplace_back();
    rows.back().push_back(panel_of(device, files[i], animation, samples));
  }
  output::write_png(picture, sheet(rows));
  return 0;
}

}  // namespace
}  // namespace previz::truth

int main(int argc, char** argv) {
  CLI::App app("Draws glTF models side by side, as previzd understands them");
  std::string picture = "models.png", animation;
  std::vector<std::string> files;
  int samples = 64;
  std::size_t columns = 6;
  app.add_option("PICTURE", picture, "PNG to write")->required();
  app.add_option("FILES", files, "glTF files")->required();
  app.add_option("--animation", animation, "shown at its start; a name, an index, or *");
  app.add_option("--spp", samples, "samples a pixel")
      ->capture_default_str()
      ->check(CLI::Range(1, 4096));
  app.add_option("--columns", columns, "panels in a row")
      ->capture_default_str()
      ->check(CLI::Range(1, 12));
  CLI11_PARSE(app, argc, argv);
  return previz::truth::run(picture, files, animation, samples, columns);
}
