// Clear solids that take light away inside (KHR_materials_volume), against closed forms: what is
// left after d metres is colour^(d / distance).
#include "shaders/lib/render_shared.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::coloured_glass_test {

constexpr double thickness_m = 0.25, attenuation_distance_m = 0.5;
const glm::dvec3 colour(0.2f, 0.5f, 1);

scene::Material coloured(float ior) {
  scene::Material material = glass(ior);
  material.attenuation_color = glm::vec3(colour);
  material.attenuation_distance_m = attenuation_distance_m;
  return material;
}

glm::dvec3 left_after(double metres) {
  return glm::pow(colour, glm::dvec3(metres / attenuation_distance_m));
}

// A slab of this material, z = 0 to thickness_m, seen from above so narrowly that every ray of the
// picture is upright: within 7e-4 rad, which makes a way longer by 2.5e-7 of itself.
View slab(const scene::Material& material) {
  View view = empty_view({0.1, 0.05, 0.8}, {0.1, 0.05, 0}, pinhole(8, 8, 1e-3), glm::vec3(1));
  add(view.scene, box_mesh({0.5, 0.5, thickness_m}), material, at({0, 0, thickness_m / 2}));
  return view;
}

// Vulkan allows exp(x) an error of (3 + 2 |x|) ulp, here 4.6 ulp or 5.5e-7. A ray starts clear of
// the surface that it leaves by the bound on the error of its place, which for coordinates and
// edges below 1 m is at most 4e-6 m (position_error() and plane_error() in lib/scene.glsl), and
// that much of the way is not counted; the strongest channel takes 3.2 / m.
constexpr double one_way = 5.5e-7 + 3.2 * 4e-6;

void expect_all(std::span<const glm::vec3> layer, const glm::dvec3& expected, double share) {
  for (const glm::vec3& pixel : layer)
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(pixel[c], expected[c], share * expected[c]) << c;
}

TEST(ColouredGlass, KeepsTheExponentialOfItsThickness) {
  const Rendered result = render_clean(slab(coloured(1)), 1);
  expect_all(result.layers.mixed, left_after(thickness_m), one_way);
  expect_all(result.layers.real, left_after(thickness_m), one_way);
}

// Light that is reflected inside crosses again: with the reflectance r of a side and what is left
// of one crossing T, the slab shows r + (1 - r)^2 T / (1 - r T), whichever estimator is used.
TEST(ColouredGlass, CountsEveryCrossing) {
  View view = slab(coloured(1.5f));
  view.scene.instances[0].presence = scene::world_mixed;
  const double r = 0.04;
  const glm::dvec3 once = left_after(thickness_m);
  const glm::dvec3 expected = r + (1 - r) * (1 - r) * once / (1.0 - r * once);
  for (const auto estimator : both_estimators) {
    // 0.04^14 of it is left out.
    const Rendered result = render_clean(view, 64, up_to_depth(16, estimator));
    // 4096 paths that end in one of few values: four standard errors of the pixels' spread.
    const double error = standard_error_of_pixels(result.layers);
    EXPECT_NEAR(mean(result.layers.mixed).g, expected.g, 4 * error + 2 * one_way);
    // What takes nothing is white, whatever way the light goes.
    EXPECT_NEAR(mean(result.layers.mixed).b, 1, 4 * error + 1e-5);
    EXPECT_EQ(mean(result.layers.real), glm::dvec3(1));
  }
}

// Something that glows inside, seen through the part of the slab above it.
TEST(ColouredGlass, ColoursWhatIsInsideIt) {
  View view = slab(coloured(1));
  add(view.scene, rectangle_mesh({0.4, 0.4}), emitter(glm::vec3(2)), at({0, 0, 0.1}));
  const Rendered result = render_clean(view, 1);
  expect_all(result.layers.mixed, 2.0 * left_after(thickness_m - 0.1), one_way);
}

// A camera within a coloured solid begins inside of it.
TEST(ColouredGlass, ColoursWhatIsSeenFromInside) {
  View view = slab(coloured(1));
  view.world_from_camera = look_at({0.1, 0.05, 0.2}, {0.1, 0.05, 0});
  expect_all(render_clean(view, 1).layers.mixed, left_after(0.2), one_way);
}

// A pane, metal and a solid without light going in have no inside.
TEST(ColouredGlass, NeedsAnInsideThatLightGetsInto) {
  scene::Material thin = coloured(1);
  thin.thin_walled = true;
  expect_all(render_clean(slab(thin), 1).layers.mixed, glm::dvec3(1), 0);
  EXPECT_FALSE(scene::attenuates(thin));
  scene::Material opaque = coloured(1);
  opaque.transmission = 0;
  EXPECT_FALSE(scene::attenuates(opaque));
  scene::Material metallic = coloured(1);
  metallic.metallic = 1;
  EXPECT_FALSE(scene::attenuates(metallic));
  EXPECT_TRUE(scene::attenuates(coloured(1)));
}

TEST(ColouredGlass, BlackLetsNothingThrough) {
  scene::Material black = coloured(1);
  black.attenuation_color = glm::vec3(0);
  black.attenuation_distance_m = 1e-30f;
  const Rendered result = render_clean(slab(black), 1);
  expect_all(result.layers.mixed, glm::dvec3(0), 0);
}

// The feature changes no bit of what is clear: glass of every kind, with paths and with photons.
TEST(ColouredGlass, LeavesWhatIsClearAloneBitForBit) {
  View view = empty_view({0, -1, 0.8}, {0, 0, 0.1}, pinhole(32, 24, 0.8), glm::vec3(0.3f));
  scene::Material rough = glass(1.5f);
  rough.roughness = 0.4f;
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
  add(view.scene, icosphere_mesh(0.2, 3), glass(1.5f), at({-0.2, 0, 0.25}), scene::world_mixed);
  add(view.scene, box_mesh({0.3, 0.3, 0.3}), rough, at({0.3, 0, 0.2}));
  view.scene.lights = {point_lamp({0, 0.3, 1})};
  SetRenderer renderer(view);
  const render::Layers without = renderer.rendered(2);
  EXPECT_EQ(renderer.needed() & gpu::FEATURE_ATTENUATION, 0u);
  renderer.carry(gpu::FEATURE_ATTENUATION);
  const render::Layers with = renderer.rendered(2);
  EXPECT_EQ(without.mixed, with.mixed);
  EXPECT_EQ(without.real, with.real);
}

// Photons through a slab that does not bend them, onto a floor 0.3 m below it: a point lamp above
// the slab, or in it. The floor at p is lit through T of the way in the slab.
void expect_floor_lit_through_slab(double lamp_z) {
  View view = empty_view({0, -0.1, 0.28}, {0, 0, 0}, pinhole(8, 8, 0.4));
  constexpr double albedo = 0.6, low = 0.3, high = low + thickness_m;
  add(view.scene, rectangle_mesh({0.6, 0.6}), diffuse(glm::vec3(albedo)));
  add(view.scene, box_mesh({0.8, 0.8, thickness_m}), coloured(1), at({0, 0, (low + high) / 2}));
  const set::Light light = point_lamp({0.05, 0.1, lamp_z}, glm::dvec3(2, 3, 5));
  view.scene.lights = {light};
  glm::dvec3 expected(0);
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const glm::dvec3 eye(view.world_from_camera[3]);
  for (const auto& [x, y, i] : pixels_of(k.width, k.height)) {
    const glm::dvec3 ray =
        glm::dmat3(view.world_from_camera) * glm::dvec3((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
    const glm::dvec3 p = eye - ray * (eye.z / ray.z);
    const glm::dvec3 to_light = light.position - p;
    const double d2 = glm::dot(to_light, to_light), cosine = to_light.z / std::sqrt(d2);
    expected += light.emission * (cosine / d2) * albedo / std::numbers::pi *
                left_after((std::min(lamp_z, high) - low) / cosine);
  }
  expected /= k.width * k.height;
  // 400 photons a pixel, of which some reach the floor.
  SetRenderer renderer(view, {.max_depth = 3, .photons = 400, .photon_radius_px = 1});
  std::vector<glm::dvec3> means;
  for (std::uint32_t seed = 1; seed <= 16; ++seed)
    means.push_back(mean(renderer.rendered_clean(4, seed).mixed));
  const auto [shown, error] = estimate_of(means);
  for (int c = 0; c < 3; ++c) EXPECT_LT(error[c], 0.02 * expected[c]) << "too noisy";
  // Photons are gathered over a pixel, 15 mm of the floor, which is off by r^2 / 12 of the
  // irradiance's Laplacian: that is -6 / h^2 of it for a lamp at the height h, and -2 sigma t / h^2
  // for the slab, together 35 / m^2 or 7e-4.
  expect_near(shown, expected, 4.0 * error + 1e-3 * expected);
}

TEST(ColouredGlass, ColoursTheLightOfPhotons) {
  expect_floor_lit_through_slab(0.9);
}

TEST(ColouredGlass, ColoursTheLightOfALampInside) {
  expect_floor_lit_through_slab(0.45);
}

}  // namespace previz::test::coloured_glass_test
