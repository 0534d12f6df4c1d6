// Surfaces that are not there everywhere, against closed forms.
#include "daemon/core/render/device/device.hpp"
#include "shaders/lib/render_shared.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::alpha_test {

constexpr double albedo = 0.6;
constexpr float veil_alpha = 0.25f;

scene::Material veil(const scene::Material& of) {
  scene::Material material = of;
  material.alpha = veil_alpha;
  material.alpha_mode = scene::AlphaMode::blend;
  return material;
}

// Squares one above the other over the origin, 1 mm apart, the lowest `height` above it.
void add_veils(View& view, int count, double height, std::uint32_t presence) {
  const auto square = add_mesh(view.scene, rectangle_mesh({0.2, 0.2}));
  const auto material = add_material(view.scene, veil(emitter(glm::vec3(0))));
  for (int i = 0; i < count; ++i) {
    add_instance(view.scene, square, material, at({0, 0, height + 1e-3 * i}), presence);
  }
}

// Each veil between the lamp and the point keeps its share, in the world it is in.
TEST(Alpha, AVeilKeepsItsShareOfALamp) {
  for (const int count : {1, 3}) {
    View view = lit_point(albedo);
    add_veils(view, count, 1, scene::world_mixed);
    view.scene.lights.push_back(lamp(set::LightType::directional));
    const render::Layers layers = render_clean(view, 1, up_to_depth(1)).layers;
    const double full = albedo / std::numbers::pi;
    EXPECT_NEAR(mean(layers.mixed).g, full * std::pow(1 - veil_alpha, count), 1e-5);
    EXPECT_NEAR(mean(layers.real).g, full, 1e-5);
  }
}

// Before the camera, by chance: black with the odds of its alpha.
TEST(Alpha, AVeilCoversItsShareOfAView) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(32, 32, 0.1), glm::vec3(1));
  add(view.scene, rectangle_mesh({1, 1}), veil(emitter(glm::vec3(0))), glm::dmat4(1),
      scene::world_mixed);
  const render::Layers layers = render_clean(view, 16).layers;
  const double tosses = 32 * 32 * 16;
  EXPECT_NEAR(mean(layers.mixed).g, 1 - veil_alpha,
              4 * std::sqrt(veil_alpha * (1 - veil_alpha) / tosses));
  EXPECT_EQ(mean(layers.real), glm::dvec3(1));
}

// A mask has no chance in it: what is below the cut-off is not there.
TEST(Alpha, AMaskIsThereOrNot) {
  for (const float cutoff : {0.2f, 0.3f}) {
    View view = lit_point(albedo);
    add_veils(view, 1, 1, scene::world_both);
    scene::Material& material = view.scene.materials.back();
    material.alpha_mode = scene::AlphaMode::mask;
    material.alpha_cutoff = cutoff;
    view.scene.lights.push_back(lamp(set::LightType::directional));
    const render::Layers layers = render_clean(view, 1, up_to_depth(1)).layers;
    const double expected = veil_alpha >= cutoff ? 0 : albedo / std::numbers::pi;
    EXPECT_NEAR(mean(layers.mixed).g, expected, 1e-5) << cutoff;
  }
}

// A material may say that it blends and have no texel that lets anything through: its rays are then
// traced as those of any opaque surface.
TEST(Alpha, IsLeftOutWhereEveryTexelIsOpaque) {
  for (const float alpha : {1.0f, 0.5f}) {
    View view = lit_point(albedo);
    scene::Material& material = view.scene.materials.back();
    material.alpha_mode = scene::AlphaMode::blend;
    material.base_color_texture =
        add_texture(view.scene, texture_of(2, 1, {{1, 1, 1, 1}, {1, 1, 1, alpha}}));
    SetRenderer renderer(view);
    renderer.begin({{}, 1.0, view.world_from_camera});
    EXPECT_EQ((renderer.needed() & gpu::FEATURE_ALPHA) != 0, alpha < 1);
  }
}

// More layers than a ray follows stop it, and are counted. In hardware it follows all of them.
TEST(Alpha, RaysThroughTooManyVeilsAreCounted) {
  View view = lit_point(albedo);
  add_veils(view, 300, 0.7, scene::world_both);
  view.scene.materials.back().alpha = 0;
  view.scene.lights.push_back(lamp(set::LightType::directional));
  const Rendered result = render_view(view, 1, up_to_depth(1));
  if (shared_device()->traces_in_hardware()) {
    EXPECT_GT(mean(result.layers.mixed).g, 0);
    EXPECT_EQ(result.counters.stopped_in_layers, 0u);
    return;
  }
  EXPECT_EQ(mean(result.layers.mixed), glm::dvec3(0));
  EXPECT_GE(result.counters.stopped_in_layers, 32u * 32u);  // and of the scattered rays, a few
}

}  // namespace previz::test::alpha_test
