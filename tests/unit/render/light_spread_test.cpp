// From how wide a solid angle light comes, which decides where directions towards objects are worth
// their work, and how samples are shared between the sky and the lamps.
#include <glm/ext/matrix_transform.hpp>

#include "daemon/core/render/world/bounds.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/render/world/gpu_lights.hpp"
#include "daemon/core/render/world/scene_lights.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::light_spread_test {

// Texels that `lit` picks by their direction, the others as bright as `rest`.
lighting::EnvironmentMap map_of(int size, const auto& lit, float rest = 0) {
  lighting::EnvironmentMap map = uniform_environment(glm::vec3(rest), size);
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i)
      if (lit(lighting::texel_direction(size, i, j)))
        map.radiance[static_cast<std::size_t>(j * size + i)] = glm::vec3(1);
  return map;
}

double spread(const lighting::EnvironmentMap& map) {
  return render::encode_environment(map).spread;
}

TEST(LightSpread, OfAnEvenSkyIsItsSolidAngle) {
  EXPECT_NEAR(spread(map_of(64, [](const auto&) { return true; })), 2, 1e-6);
  // The interpolation widens the edge by a texel: 4 * 128 of 128^2.
  EXPECT_NEAR(spread(map_of(128, [](const auto& d) { return d.z > 0; })), 1, 4.0 / 128);
  EXPECT_EQ(spread(map_of(1, [](const auto&) { return true; })), 2);
}

TEST(LightSpread, OfNoLightIsThatOfAnEvenSky) {
  EXPECT_EQ(spread(map_of(32, [](const auto&) { return false; })), 2);
}

// The rim has 2 pi sin(r) / t texels of the side t that are lit in part; the entropy may count each
// as whole, t^2 / (2 pi) more of solid angle over 2 pi.
TEST(LightSpread, OfALampIsItsDisc) {
  const double radius = 0.2, side = std::sqrt(4 * std::numbers::pi) / 256;
  const double cap = 1 - std::cos(radius);
  const double lamp = spread(map_of(1024, [&](const auto& d) { return d.z > std::cos(radius); }));
  EXPECT_GE(lamp, cap * (1 - 1e-3));
  EXPECT_LE(lamp, cap + std::sin(radius) * side);
}

gpu::GpuLight shining(std::uint32_t type) {
  gpu::GpuLight light{};
  light.type = type;
  light.emission = glm::vec3(1);
  light.gain_mixed = light.gain_real = glm::vec3(1);
  return light;
}

TEST(LightSpread, OfLightsIsThatOfAllTogether) {
  gpu::GpuLight lamp = shining(gpu::LIGHT_DIRECTIONAL);
  lamp.cone_sr = 2e-3f;
  const double disc = 2e-3 / (2 * std::numbers::pi);
  EXPECT_NEAR(render::spread_of({lamp}, 1), disc, 1e-6 * disc);
  EXPECT_NEAR(render::spread_of({lamp, lamp}, 1), 2 * disc, 1e-6 * disc);
  gpu::GpuLight black = lamp;
  black.emission = glm::vec3(0);
  EXPECT_NEAR(render::spread_of({lamp, black}, 1), disc, 1e-6 * disc);
  EXPECT_EQ(render::spread_of({}, 1), 2);
  EXPECT_EQ(render::spread_of({black}, 1), 2);
}

TEST(LightSpread, OfALightIsItsSizeAtTheScenesRadius) {
  const double two_pi = 2 * std::numbers::pi;
  gpu::GpuLight panel = shining(gpu::LIGHT_RECTANGLE);
  panel.edge_u = {2, 0, 0};
  panel.edge_v = {0, 1, 0};
  EXPECT_NEAR(render::spread_of({panel}, 10), 0.02 / two_pi, 1e-8);
  panel.type = gpu::LIGHT_TRIANGLE;
  EXPECT_NEAR(render::spread_of({panel}, 10), 0.01 / two_pi, 1e-8);
  gpu::GpuLight ball = shining(gpu::LIGHT_SPHERE);
  ball.radius = 1;
  EXPECT_NEAR(render::spread_of({ball}, 10), std::numbers::pi * 0.01 / two_pi, 1e-8);
  const double point = render::spread_of({shining(gpu::LIGHT_POINT)}, 10);
  EXPECT_GT(point, 0);
  EXPECT_LT(point, 1e-12);
}

// A floor and a virtual box on it.
View box_on_a_floor() {
  View view = empty_view({0, -2, 1.5}, {0, 0, 0.2}, pinhole(32, 24, 0.9));
  const std::uint32_t grey = add_material(view.scene, diffuse(glm::vec3(0.5f)));
  add(view.scene, rectangle_mesh({3, 3}), grey);
  add(view.scene, box_mesh(glm::dvec3(0.5)), grey, at({0, 0, 0.25}), scene::world_mixed);
  return view;
}

// The rays of a sample a pixel, with directions towards the box and without.
struct Rays {
  std::uint64_t with, without;
  bool same_picture;
};

Rays rays_of(const View& view, set::LightSampling sampling = set::LightSampling::importance) {
  const Rendered with = render_clean(view, 4, {}, sampling);
  const Rendered without = render_clean(view, 4, {.difference_sampling = 0}, sampling);
  return {with.counters.rays, without.counters.rays,
          with.layers.mixed == without.layers.mixed && with.layers.diff == without.layers.diff};
}

TEST(DirectionsTowardsWhatDiffers, AreTakenUnderASkyAndNotUnderALamp) {
  View view = box_on_a_floor();
  view.environment = uniform_environment(glm::vec3(1));
  const Rays sky = rays_of(view);
  EXPECT_GT(sky.with, sky.without);
  EXPECT_FALSE(sky.same_picture);

  set::Light sun = sun_lamp({0.3, 0.2, -1}, 0.0047);
  view.environment = uniform_environment(glm::vec3(0));
  view.scene.lights = {sun};
  EXPECT_TRUE(rays_of(view).same_picture);

  // A lamp that is faint beside the sky changes nothing that could be seen: of the rays that the
  // directions cost, some thousand, less than a tenth, three deviations of such a number.
  sun.emission = glm::dvec3(1e-6);
  view.environment = uniform_environment(glm::vec3(1));
  view.scene.lights = {sun};
  const Rays both = rays_of(view);
  const auto more = [](const Rays& rays) {
    return static_cast<double>(rays.with) / static_cast<double>(rays.without);
  };
  EXPECT_NEAR(more(both), more(sky), 0.1 * (more(sky) - 1));
}

// What is left to luck is looked for in every way there is.
TEST(DirectionsTowardsWhatDiffers, AreTakenWhereALampIsFoundByLuck) {
  View view = box_on_a_floor();
  view.environment = map_of(256, [](const auto& d) { return d.z > std::cos(0.02f); });
  EXPECT_TRUE(rays_of(view).same_picture);
  EXPECT_FALSE(rays_of(view, set::LightSampling::bsdf).same_picture);
}

TEST(DirectionsTowardsWhatDiffers, AreThoseOfTheFrameHoweverOftenItIsBegun) {
  View view = box_on_a_floor();
  view.scene.lights = {panel_lamp({0, 0, 3}, {2, 2}, glm::dvec3(5))};
  SetRenderer renderer(view);
  const auto first = renderer.rendered(4).mixed;
  EXPECT_EQ(renderer.rendered(4).mixed, first);
}

// A virtual ball on a floor of 14 m under an even sky, and a lamp 0.9 m away, of a thousand times
// the sky's radiance.
View ball_beside_a_lamp() {
  View view = empty_view({0, -0.8, 0.6}, {0, 0, 0.05}, pinhole(32, 32, 0.4), glm::vec3(0.1f));
  const std::uint32_t grey = add_material(view.scene, diffuse(glm::vec3(0.5f)));
  add(view.scene, rectangle_mesh({14, 14}), grey);
  add(view.scene, icosphere_mesh(0.1, 3), grey, at({0, 0, 0.1}), scene::world_mixed);
  view.scene.lights = {sphere_lamp({0.6, 0, 0.8}, 0.05, glm::dvec3(100))};
  return view;
}

// The box around the ball and the lamp is 0.75 m by 0.2 m by 0.85 m, half its diagonal 0.576 m, and
// the half octave next to it below a scene's 8 m is 0.5 m.
TEST(LightShare, IsThatOfTheBoxAroundWhatDiffersAndTheLamps) {
  const auto radius_of = [](const scene::Scene& scene, const std::vector<set::Light>& lamps) {
    render::SceneLights lights(*shared_device());
    lights.set_scene(scene);
    const render::Spheres spheres = render::bounding_spheres(scene);
    return render::lit_radius(scene, spheres, lights.shining(scene, spheres, lamps), 8);
  };
  scene::Scene scene = ball_beside_a_lamp().scene;
  std::vector<set::Light> lamps = scene.lights;
  EXPECT_DOUBLE_EQ(radius_of(scene, lamps), 0.5);
  lamps.push_back(lamp(set::LightType::directional));
  lamps.push_back(lamp(set::LightType::point, glm::dvec3(0)));
  lamps.push_back(lamp(set::LightType::point));
  lamps[3].gain_mixed = lamps[3].gain_real = 0;
  for (int i = 1; i < 4; ++i) lamps[i].position = {50, 0, 0};
  EXPECT_DOUBLE_EQ(radius_of(scene, lamps), 0.5) << "a sun and lamps that are off do not count";
  EXPECT_EQ(radius_of(scene, {lamps[1]}), 8) << "nothing but a sun shines";
  lamps[3].gain_mixed = 1;
  EXPECT_EQ(radius_of(scene, {lamps[3]}), 8) << "no more than the scene";
  // The ball of light has pi 100 of 4 pi 0.05^2 m^2, 9.87 W, the point at 50 m has 4 pi, 12.57 W.
  // With them R^2 = 22.4 / (9.87 / 0.576^2 + 12.57 / 25^2), 0.87 m: the half octave is 1 m.
  EXPECT_DOUBLE_EQ(radius_of(scene, lamps), 1) << "each counts by its power";
  lamps[3].emission *= 0.01;
  EXPECT_DOUBLE_EQ(radius_of(scene, lamps), 0.5) << "a faint lamp far off hardly counts";
  lamps[3] = lamps[0];
  lamps[3].position = {-0.6, 0, 0.8};
  EXPECT_DOUBLE_EQ(radius_of(scene, lamps), 0.5) << "two at the same distance count as one there";

  // A panel that glows counts as a lamp does: 3 m above, it makes a box of 1.6 m, hence sqrt(2).
  add(scene, rectangle_mesh({0.1, 0.1}), emitter(glm::vec3(1)), at({0, 0, 3}));
  EXPECT_DOUBLE_EQ(radius_of(scene, {}), std::numbers::sqrt2);
  // Each of its two sides of 0.01 m^2 shines with pi, both with 0.063 W, as a point of 0.005 W/sr
  // does. With such a point, whose box has half a diagonal of 0.54 m, R^2 = 2 / (1 / 1.54^2 + 1 /
  // 0.54^2), 0.72 m, hence sqrt(0.5); a panel twice as wide and high has four times the power,
  // hence 5 / (4 / 1.59^2 + 1 / 0.54^2), 1.00 m.
  set::Light point = point_lamp(lamps[0].position, glm::dvec3(0.005));
  EXPECT_DOUBLE_EQ(radius_of(scene, {point}), std::numbers::sqrt2 / 2);
  glm::dmat4& placed = scene.instances[2].world_from_object;
  placed = glm::scale(placed, glm::dvec3(2));
  EXPECT_DOUBLE_EQ(radius_of(scene, {point}), 1);
  scene.instances[1].presence = scene::world_both;
  EXPECT_EQ(radius_of(scene, scene.lights), 8) << "nothing differs";
  scene.instances[1].presence = scene::world_mixed;
  scene.instances[2].presence = 0;
  EXPECT_EQ(radius_of(scene, {}), 8) << "the panel is taken away";
}

// The variance of a pixel's mean on average over the pixels of the composite (green), and that
// average's standard error, an over-estimate because the pixels are not alike.
struct Variance {
  double mean = 0, error = 0;
};

Variance variance_of(const render::Layers& layers) {
  const auto n = static_cast<double>(layers.variance.size());
  double sum = 0, squares = 0;
  for (const glm::vec3& pixel : layers.variance) {
    sum += pixel.g;
    squares += 1.0 * pixel.g * pixel.g;
  }
  return {sum / n, std::sqrt(std::max(squares / n - sum / n * sum / n, 0.0) / n)};
}

// A second ball, out of sight below the far corner of the floor, makes all of the floor what is
// lit: the sky then gets the nine tenths of the samples that are the most it can get. A lamp that a
// share p of the samples looks for leaves the variance (1 / p - 1) f^2 of what it brings, f: 9 f^2
// for a tenth, f^2 / 9 for nine tenths. Less than a ninth of all variance is left as long as the
// rest, which the share hardly changes, is less than f^2.
TEST(LightShare, LeavesTheLampBesideAnObjectItsSamples) {
  const View near = ball_beside_a_lamp();
  View wide = near;
  add(wide.scene, icosphere_mesh(0.05, 1), 0u, at({6.8, 6.8, -0.1}), scene::world_mixed);
  const render::Layers few = render_clean(near, 64, up_to_depth(2)).layers;
  const render::Layers many = render_clean(wide, 64, up_to_depth(2)).layers;
  const Variance by_near = variance_of(few), by_wide = variance_of(many);
  EXPECT_LT(by_near.error, 0.1 * by_near.mean);
  EXPECT_LT(by_wide.error, 0.1 * by_wide.mean);
  EXPECT_LT(by_near.mean + 4 * by_near.error, (by_wide.mean - 4 * by_wide.error) / 9);
  EXPECT_NEAR(mean(few.composite).g, mean(many.composite).g,
              4 * std::hypot(standard_error(few).g, standard_error(many).g));
}

// A lamp far off, of a thousandth of the lamp's power, lights nothing to speak of. It takes its
// part of the tenth that lamps share evenly. So the lamp beside the object keeps at least
// 0.9 * 0.99 + 0.05 of the nine tenths that lamps get, and the variance (1 / p - 1) f^2 of what it
// brings (above) rises accordingly, that of the rest not at all.
TEST(LightShare, AFaintLampFarOffTakesNoneFromTheLampBesideAnObject) {
  const View alone = ball_beside_a_lamp();
  View both = alone;
  both.scene.lights.push_back(point_lamp({6.5, 6.5, 1}, glm::dvec3(1e-3)));
  const Variance before = variance_of(render_clean(alone, 64, up_to_depth(2)).layers);
  const Variance after = variance_of(render_clean(both, 64, up_to_depth(2)).layers);
  EXPECT_LT(before.error, 0.1 * before.mean);
  EXPECT_LT(after.error, 0.1 * after.mean);
  constexpr double lamps = 0.9, near = lamps * (0.9 * 0.99 + 0.05);
  EXPECT_LT(after.mean - 4 * after.error,
            (1 / near - 1) / (1 / lamps - 1) * (before.mean + 4 * before.error));
  std::printf("variance of a pixel: %g alone, %g with a faint lamp far off\n", before.mean,
              after.mean);
}

// A room of albedo 1/2, with a ball that is in one world only: each bounce leaves half of a path's
// light.
View shining_room() {
  View view = empty_view({1.5, 1.5, 1}, {0.5, 0.8, 0}, pinhole(48, 36, 0.9));
  scene::Material wall = diffuse(glm::vec3(0.5f));
  wall.emission = glm::vec3(1);
  view.scene = furnace_box({4, 4, 4}, wall);
  add(view.scene, icosphere_mesh(0.5, 2), diffuse(glm::vec3(0.5f)), glm::dmat4(1),
      scene::world_mixed);
  return view;
}

render::Layers played(int max_depth, int roulette_depth) {
  set::Estimation estimation = up_to_depth(max_depth);
  estimation.difference_sampling = 0;  // every direction leaves the albedo
  estimation.roulette_depth = roulette_depth;
  return SetRenderer(shining_room(), estimation).rendered_clean(16, 1);
}

// After three bounces an eighth is left, more than a tenth.
TEST(Roulette, SparesAPathUntilATenthOfItsLightIsLeft) {
  const render::Layers with = played(3, 1), without = played(3, 64);
  EXPECT_GT(mean(with.mixed).g, 1.5);  // of 1 + 1/2 + 1/4 + 1/8 + 1/16
  for (std::size_t i = 0; i < with.mixed.size(); ++i) {
    ASSERT_EQ(with.mixed[i], without.mixed[i]);
    ASSERT_EQ(with.diff[i], without.diff[i]);
  }
}

TEST(Roulette, EndsFaintPathsAndKeepsTheMean) {
  const render::Layers with = played(16, 1), without = played(16, 64);
  EXPECT_NE(mean(with.mixed), mean(without.mixed));
  EXPECT_NEAR(mean(with.mixed).g, mean(without.mixed).g,
              4 * std::hypot(standard_error_of_pixels(with), standard_error_of_pixels(without)));
}

}  // namespace previz::test::light_spread_test
