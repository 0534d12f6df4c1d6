// White furnaces: in a uniform environment of radiance 1 a surface that absorbs nothing is
// invisible, and one that does shows its closed form.
#include <numbers>

#include "tests/unit/render_fixture.hpp"

namespace previz::testing {
namespace {

View sphere_in_furnace(const scene::Material& material, int subdivisions = 4) {
  View view;
  const auto mesh = add_mesh(view.scene, icosphere_mesh(0.5, subdivisions));
  add_instance(view.scene, mesh, add_material(view.scene, material));
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(32, 32, 0.5);
  view.world_from_camera = look_at({0, -4, 0}, {0, 0, 0});
  return view;
}

TEST(Furnace, an_empty_scene_shows_the_environment_exactly) {
  View view;
  view.environment = uniform_environment(glm::vec3(0.25f, 0.5f, 2.0f));
  view.calibration = pinhole(33, 17, 0.9);
  const Rendered result = render_view(view, 3);
  for (const glm::vec3& pixel : result.layers.mixed)
    EXPECT_EQ(pixel, glm::vec3(0.25f, 0.5f, 2.0f));
  expect_clean(result.counters);
}

TEST(Furnace, lambert_reflects_its_albedo) {
  for (const float albedo : {0.0f, 0.5f, 1.0f}) {
    const View view = sphere_in_furnace(diffuse(glm::vec3(albedo)));
    const Rendered result = render_view(view, 64);
    const auto centre = result.layers.mixed[16 * 32 + 16];
    // The light sample and the scattered path meet the same radiance; what remains is the MIS
    // weights' noise. 64 samples, relative deviation of one at most 1: 4 / sqrt(64) = 0.5 bounds a
    // pixel; the mean over the middle 8x8 pixels is 8 times closer.
    double sum = 0;
    for (int y = 12; y < 20; ++y)
      for (int x = 12; x < 20; ++x) sum += result.layers.mixed[y * 32 + x].g;
    EXPECT_NEAR(sum / 64, albedo, 0.0625 * albedo) << centre.g;
    expect_clean(result.counters);
  }
}

}  // namespace
}  // namespace previz::testing
