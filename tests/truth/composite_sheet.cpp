// Where each way to put the difference of the worlds onto the plate errs (estimator.composite): a
// phantom floor whose albedo is guessed at half of what it is, with texture that the model does not
// know; and a floor that no real light reaches, under a virtual lamp.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

#include "daemon/output/png.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/set/names.hpp"
#include "drivers/plate.hpp"
#include "tests/support/scenes.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/comparison_sheet.hpp"

namespace previz::truth {
namespace {

using namespace previz::test;

constexpr int width = 240, height = 160;
constexpr double white = 2;  // of the sensor

// Boards of two colours.
scene::Texture boards() {
  scene::Texture texture;
  texture.width = texture.height = 8;
  texture.nearest = true;
  for (int i = 0; i < 64; ++i)
    texture.texels.emplace_back((i / 8) % 2 == 0 ? glm::vec4(0.95f, 0.75f, 0.5f, 1)
                                                 : glm::vec4(0.5f, 0.55f, 0.7f, 1));
  return texture;
}

// A floor in both worlds, with a red virtual ball on it.
View stage(const scene::Material& floor, float sky) {
  View view;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({3, 3})),
               add_material(view.scene, floor));
  glm::dmat4 pose(1);
  pose[3] = {-0.3, 0.1, 0.35, 1};
  add_instance(view.scene, add_mesh(view.scene, icosphere_mesh(0.35, 4)),
               add_material(view.scene, diffuse({0.7f, 0.1f, 0.08f})), pose, scene::world_mixed);
  view.environment = {4, std::vector<glm::vec3>(16, glm::vec3(sky))};
  view.calibration = pinhole(width, height, 0.8);
  view.world_from_camera = look_at({0, -2.4, 1.5}, {0, 0.1, 0.15});
  return view;
}

View sunny(const scene::Material& floor) {
  View view = stage(floor, 0.25f);
  set::Light sun = lamp(set::LightType::directional, {2.2, 2.1, 2.0});
  sun.direction = glm::normalize(glm::dvec3(0.7, 0.4, -1));
  sun.angular_radius_rad = 0.02;
  view.scene.lights.push_back(sun);
  return view;
}

View at_night(const scene::Material& floor) {
  View view = stage(floor, 0);
  set::Light spot = lamp(set::LightType::spot, {4, 3.4, 2.4});
  spot.gain_real = 0;
  spot.position = {0.9, -0.4, 1.6};
  spot.direction = glm::normalize(glm::dvec3(-0.5, 0.3, -1));
  spot.inner_cone_rad = 0.3;
  spot.outer_cone_rad = 0.6;
  view.scene.lights.push_back(spot);
  return view;
}

render::Layers rendered(const std::shared_ptr<render::Device>& device, const View& view,
                        const Plate& plate, set::Composite composite) {
  set::Estimation estimation;
  estimation.composite = composite;
  render::Renderer renderer(device, estimation, view.calibration);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, set::LightSampling::importance);
  renderer.begin({std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera});
  renderer.render(64);
  return renderer.layers();
}

Plate shown(const View& view, const std::vector<glm::vec3>& radiance) {
  return displayed(radiance, width, height, 1 / white, view.calibration.response);
}

// rms of what is off over rms of the truth.
double error_of(const std::vector<glm::vec3>& picture, const std::vector<glm::vec3>& truth) {
  double off = 0, all = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const glm::dvec3 d = glm::dvec3(picture[i]) - glm::dvec3(truth[i]);
    off += glm::dot(d, d);
    all += glm::dot(glm::dvec3(truth[i]), glm::dvec3(truth[i]));
  }
  return std::sqrt(off / all);
}

// `actual` is how it is, `modelled` what the set file says.
std::vector<Panel> row(const std::shared_ptr<render::Device>& device, const char* name,
                       const View& actual, const View& modelled) {
  const render::Layers truth = rendered(device, actual, {}, set::Composite::additive);
  const Plate plate = shown(actual, truth.real);
  std::vector<Panel> panels = {{std::string(name) + ": plate", plate}};
  for (const auto composite :
       {set::Composite::additive, set::Composite::ratio, set::Composite::hybrid}) {
    const render::Layers layers = rendered(device, modelled, plate, composite);
    const std::string caption = set::name_of(composite);
    char error[32];
    std::snprintf(error, sizeof(error), ", off by %.1f %%",
                  100 * error_of(layers.composite, truth.mixed));
    panels.push_back({caption + error, shown(modelled, layers.composite)});
  }
  panels.push_back({"truth", shown(actual, truth.mixed)});
  return panels;
}

int run(const std::string& file) {
  const auto device = render::open_device();
  scene::Material floor = diffuse(glm::vec3(1));
  View actual = sunny(floor), night = at_night(floor);
  for (View* view : {&actual, &night})
    view->scene.materials[0].base_color_texture = add_texture(view->scene, boards());
  const View half = sunny(diffuse({0.36f, 0.33f, 0.3f}));
  output::write_png(file, sheet({row(device, "albedo guessed at half", actual, half),
                                 row(device, "no real light", night, night)}));
  return 0;
}

}  // namespace
}  // namespace previz::truth

int main(int argc, char** argv) {
  CLI::App app("Draws where each composite errs, with the error of each in the whole picture");
  std::string file = "composites.png";
  app.add_option("FILE", file, "PNG to write")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return previz::truth::run(file);
}
