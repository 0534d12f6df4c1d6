// Clear solids that take light away inside (KHR_materials_volume), against closed forms: what is
// left after d metres is colour^(d / distance).
#include <functional>
#include <numbers>

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

glm::dmat4 at(const glm::dvec3& place) {
  glm::dmat4 pose(1);
  pose[3] = glm::dvec4(place, 1);
  return pose;
}

// A slab of this material, z = 0 to thickness_m, seen from above so narrowly that every ray of the
// picture is upright: within 7e-4 rad, which makes a way longer by 2.5e-7 of itself.
View slab(const scene::Material& material) {
  View view;
  add_instance(view.scene, add_mesh(view.scene, box_mesh({0.5, 0.5, thickness_m})),
               add_material(view.scene, material), at({0, 0, thickness_m / 2}));
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(8, 8, 1e-3);
  view.world_from_camera = look_at({0.1, 0.05, 0.8}, {0.1, 0.05, 0});
  return view;
}

// Vulkan allows exp(x) an error of (3 + 2 |x|) ulp, here 4.6 ulp or 5.5e-7. A ray starts clear of
// the surface that it leaves by the bound on the error of its place, which for coordinates and
// edges below 1 m is at most 4e-6 m (position_error() and plane_error() in lib/scene.glsl), and
// that much of the way is not counted; the strongest channel takes 3.2 / m.
constexpr double one_way = 5.5e-7 + 3.2 * 4e-6;

void expect_all(const std::vector<glm::vec3>& layer, const glm::dvec3& expected, double share) {
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
  for (const auto estimator : {set::Estimator::paired, set::Estimator::difference}) {
    set::Estimation estimation = up_to_depth(16);  // 0.04^14 of it is left out
    estimation.estimator = estimator;
    const Rendered result = render_clean(view, 64, estimation);
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
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({0.4, 0.4})),
               add_material(view.scene, emitter(glm::vec3(2))), at({0, 0, 0.1}));
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
  scene::Material pane = coloured(1);
  pane.thin_walled = true;
  expect_all(render_clean(slab(pane), 1).layers.mixed, glm::dvec3(1), 0);
  EXPECT_FALSE(scene::attenuates(pane));
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
  View view;
  scene::Material rough = glass(1.5f);
  rough.roughness = 0.4f;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({2, 2})),
               add_material(view.scene, diffuse(glm::vec3(0.5f))));
  add_instance(view.scene, add_mesh(view.scene, icosphere_mesh(0.2, 3)),
               add_material(view.scene, glass(1.5f)), at({-0.2, 0, 0.25}), scene::world_mixed);
  add_instance(view.scene, add_mesh(view.scene, box_mesh({0.3, 0.3, 0.3})),
               add_material(view.scene, rough), at({0.3, 0, 0.2}));
  view.environment = uniform_environment(glm::vec3(0.3f));
  view.scene.lights.push_back(lamp(set::LightType::point));
  view.scene.lights.back().position = {0, 0.3, 1};
  view.calibration = pinhole(32, 24, 0.8);
  view.world_from_camera = look_at({0, -1, 0.8}, {0, 0, 0.1});
  SetRenderer renderer(view);
  const auto picture = [&] {
    renderer.begin({{}, 1.0, view.world_from_camera});
    renderer.render(2);
    return renderer.layers();
  };
  const render::Layers without = picture();
  EXPECT_EQ(renderer.needed() & gpu::FEATURE_ATTENUATION, 0u);
  renderer.carry(gpu::FEATURE_ATTENUATION);
  const render::Layers with = picture();
  EXPECT_EQ(without.mixed, with.mixed);
  EXPECT_EQ(without.real, with.real);
}

// Photons through a slab that does not bend them, onto a floor 0.3 m below it: a point lamp above
// the slab, or in it. The floor at p is lit through T of the way in the slab.
void expect_floor_lit_through_slab(double lamp_z) {
  View view;
  constexpr double albedo = 0.6, low = 0.3, high = low + thickness_m;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({0.6, 0.6})),
               add_material(view.scene, diffuse(glm::vec3(albedo))));
  add_instance(view.scene, add_mesh(view.scene, box_mesh({0.8, 0.8, thickness_m})),
               add_material(view.scene, coloured(1)), at({0, 0, (low + high) / 2}));
  set::Light light = lamp(set::LightType::point, glm::dvec3(2, 3, 5));
  light.position = {0.05, 0.1, lamp_z};
  view.scene.lights.push_back(light);
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = pinhole(8, 8, 0.4);
  view.world_from_camera = look_at({0, -0.1, 0.28}, {0, 0, 0});
  set::Estimation estimation = up_to_depth(3);
  estimation.photons = 400;  // a pixel; some reach the floor
  estimation.photon_radius_px = 1;
  glm::dvec3 expected(0), sum(0), squares(0);
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const glm::dvec3 eye(view.world_from_camera[3]);
  for (int y = 0; y < k.height; ++y)
    for (int x = 0; x < k.width; ++x) {
      const glm::dvec3 ray =
          glm::dmat3(view.world_from_camera) * glm::dvec3((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
      const glm::dvec3 p = eye - ray * (eye.z / ray.z);
      const glm::dvec3 to_light = light.position - p;
      const double d2 = glm::dot(to_light, to_light), cosine = to_light.z / std::sqrt(d2);
      expected += light.emission * (cosine / d2) * albedo / std::numbers::pi *
                  left_after((std::min(lamp_z, high) - low) / cosine);
    }
  expected /= k.width * k.height;
  constexpr int scrambles = 16;
  SetRenderer renderer(view, estimation);
  for (std::uint32_t seed = 1; seed <= scrambles; ++seed) {
    renderer.begin({{}, 1.0, view.world_from_camera, seed});
    renderer.render(4);
    const glm::dvec3 shown = mean(renderer.layers().mixed);
    sum += shown / double(scrambles);
    squares += shown * shown / double(scrambles);
  }
  expect_clean(renderer.counters());
  for (int c = 0; c < 3; ++c) {
    const double error = std::sqrt((squares[c] - sum[c] * sum[c]) / (scrambles - 1.0));
    EXPECT_LT(error, 0.02 * expected[c]) << "too noisy to say anything";
    // Photons are gathered over a pixel, 15 mm of the floor, which is off by r^2 / 12 of the
    // irradiance's Laplacian: that is -6 / h^2 of it for a lamp at the height h, and -2 sigma t /
    // h^2 for the slab, together 35 / m^2 or 7e-4.
    EXPECT_NEAR(sum[c], expected[c], 4 * error + 1e-3 * expected[c]) << "channel " << c;
  }
}

TEST(ColouredGlass, ColoursTheLightOfPhotons) {
  expect_floor_lit_through_slab(0.9);
}

TEST(ColouredGlass, ColoursTheLightOfALampInside) {
  expect_floor_lit_through_slab(0.45);
}

}  // namespace previz::test::coloured_glass_test
