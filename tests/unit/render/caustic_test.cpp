// Light that a mirror throws onto a Lambert floor, brought by photons, against closed forms: a
// plane mirror makes an image of the lamp, so the floor at p receives E(p) + E(p mirrored).
#include "daemon/core/render/passes/photon_schedule.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::caustic_test {

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.6;
constexpr double mirror_x = 1;

// A floor z = 0 around the origin and a mirror x = 1 beside it, 2 m wide and 2 m high.
View mirror_and_floor(std::uint32_t mirror_presence = scene::world_both, double floor_m = 1) {
  View view = empty_view({0, -0.4, 1}, {0, 0, 0}, pinhole(16, 16, 0.3));
  add(view.scene, rectangle_mesh({floor_m, floor_m}), diffuse(glm::vec3(albedo)));
  glm::dmat4 pose(1);  // its normal towards -X
  pose[0] = {0, 0, 1, 0};
  pose[1] = {0, 1, 0, 0};
  pose[2] = {-1, 0, 0, 0};
  pose[3] = {mirror_x, 0, 1, 1};
  add(view.scene, rectangle_mesh({2, 2}), metal(glm::vec3(1), 0), pose, mirror_presence);
  return view;
}

// Where the centre of a pixel meets the floor.
glm::dvec3 floor_point(const View& view, int x, int y) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const glm::dvec4 ray =
      view.world_from_camera * glm::dvec4((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1, 0);
  const glm::dvec3 eye(view.world_from_camera[3]);
  return eye - glm::dvec3(ray) * (eye.z / ray.z);
}

// Mean over the picture of the floor's radiance where a lamp brings the irradiance E.
glm::dvec3 expected_mean(const View& view, const std::function<glm::dvec3(glm::dvec3)>& irradiance,
                         bool with_mirror) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  glm::dvec3 sum(0);
  for (const auto& [x, y, i] : pixels_of(k.width, k.height)) {
    const glm::dvec3 p = floor_point(view, x, y);
    sum += irradiance(p);
    if (with_mirror) sum += irradiance({2 * mirror_x - p.x, p.y, p.z});
  }
  return sum * (albedo / pi / (k.width * k.height));
}

set::Estimation photon_estimation() {
  // The mirror and the floor.
  return {.max_depth = 2, .photons = 20, .photon_radius_px = 2};
}

// Both worlds' mean over independent scrambles, with its standard error.
struct Measured {
  glm::dvec3 mixed{0}, real{0}, error{0};
};

Measured measure(const View& view, const set::Estimation& estimation) {
  SetRenderer renderer(view, estimation);
  std::vector<glm::dvec3> mixed, real;
  for (std::uint32_t i = 0; i < 16; ++i) {
    const render::Layers layers = renderer.rendered_clean(8, 100 + i);
    mixed.push_back(mean(layers.mixed));
    real.push_back(mean(layers.real));
  }
  const Estimate of_mixed = estimate_of(mixed);
  return {of_mixed.mean, estimate_of(real).mean, of_mixed.error};
}

// Within four standard errors, and 0.3 % for the disc over which photons are gathered: 3 cm, so the
// second-order error r^2 E'' / 12 is below 0.1 % of E for lamps a metre away, and as much for
// pixels.
void expect_image(const View& view, const std::function<glm::dvec3(glm::dvec3)>& irradiance) {
  const Measured measured = measure(view, photon_estimation());
  const glm::dvec3 expected = expected_mean(view, irradiance, true);
  expect_near(measured.mixed, expected, 4.0 * measured.error + 3e-3 * expected);
  EXPECT_EQ(measured.mixed, measured.real);
  // The image is a good part of it, or this would show nothing.
  EXPECT_GT(expected.g, 1.1 * expected_mean(view, irradiance, false).g);
}

const glm::dvec3 colour(2, 3, 5), above_floor(0.2, 0.3, 1.2);
const set::Light key = point_lamp(above_floor, colour);

glm::dvec3 point_irradiance(const set::Light& light, const glm::dvec3& p) {
  const glm::dvec3 to_light = light.position - p;
  const double d2 = glm::dot(to_light, to_light);
  return light.emission * (to_light.z / (d2 * std::sqrt(d2)));
}

TEST(MirrorCaustic, OfAPoint) {
  View view = mirror_and_floor();
  view.scene.lights = {key};
  expect_image(view, [&](const glm::dvec3& p) { return point_irradiance(key, p); });
}

TEST(MirrorCaustic, OfASpot) {
  View view = mirror_and_floor();
  set::Light light = key;
  light.type = set::LightType::spot;
  light.direction = glm::normalize(glm::dvec3(1, -0.2, -1));
  light.inner_cone_rad = 0.3;
  light.outer_cone_rad = 1.2;
  view.scene.lights.push_back(light);
  expect_image(view, [&](const glm::dvec3& p) {
    const double cosine = glm::dot(glm::normalize(p - light.position), light.direction);
    const double x =
        std::clamp((cosine - std::cos(1.2)) / (std::cos(0.3) - std::cos(1.2)), 0.0, 1.0);
    return point_irradiance(light, p) * (x * x * (3 - 2 * x));
  });
}

TEST(MirrorCaustic, OfASunWithoutAndWithADisc) {
  for (const double radius : {0.0, 0.1}) {
    View view = mirror_and_floor();
    const set::Light light = sun_lamp(glm::normalize(glm::dvec3(1, 0, -1)), radius, colour);
    view.scene.lights.push_back(light);
    expect_image(view, [&](const glm::dvec3&) { return light.emission * -light.direction.z; });
  }
}

TEST(MirrorCaustic, OfASphere) {
  View view = mirror_and_floor();
  const set::Light light = sphere_lamp(above_floor, 0.2, colour);
  view.scene.lights.push_back(light);
  expect_image(view, [&](const glm::dvec3& p) {
    const glm::dvec3 to_light = light.position - p;
    const double d2 = glm::dot(to_light, to_light);
    return light.emission *
           (pi * light.radius_m * light.radius_m / d2 * to_light.z / std::sqrt(d2));
  });
}

// Of a rectangle that faces down, by the midpoint rule.
glm::dvec3 rectangle_irradiance(const set::Light& light, const glm::dvec3& p) {
  constexpr int steps = 16;
  double sum = 0;
  for (int i = 0; i < steps * steps; ++i) {
    const int row = i / steps;
    const int column = i % steps;
    const glm::dvec3 at = light.position +
                          glm::dvec3(((column + 0.5) / steps - 0.5) * light.width_m,
                                     ((row + 0.5) / steps - 0.5) * light.height_m, 0) -
                          p;
    const double d2 = glm::dot(at, at);
    sum += at.z * at.z / (d2 * d2);
  }
  return light.emission * (light.width_m * light.height_m * sum / (steps * steps));
}

TEST(MirrorCaustic, OfARectangleAndOfAnEmissiveMesh) {
  const set::Light light = panel_lamp(above_floor, {0.3, 0.5}, colour);
  View with_light = mirror_and_floor();
  with_light.scene.lights.push_back(light);
  expect_image(with_light, [&](const glm::dvec3& p) { return rectangle_irradiance(light, p); });

  View with_mesh = mirror_and_floor();
  add(with_mesh.scene, rectangle_mesh({light.width_m, light.height_m}),
      emitter(glm::vec3(light.emission)), at(light.position));
  expect_image(with_mesh, [&](const glm::dvec3& p) { return rectangle_irradiance(light, p); });
}

// In a uniform environment a perfect mirror is invisible: the floor is lit as if it were not there.
// (It is so small that the mirror shows the floor nothing of itself.)
TEST(MirrorCaustic, OfAUniformEnvironment) {
  View view = mirror_and_floor(scene::world_both, 0.7);
  view.environment = uniform_environment({1, 2, 3});
  const Measured measured = measure(view, photon_estimation());
  const glm::dvec3 sky(1, 2, 3);
  expect_near(measured.mixed, albedo * sky, 4.0 * measured.error + 2e-3 * sky);
}

TEST(MirrorCaustic, OfAVirtualMirrorAndOfARemovedOne) {
  for (const std::uint32_t presence : {scene::world_mixed, scene::world_real}) {
    View view = mirror_and_floor(presence);
    view.scene.lights = {key};
    const Measured measured = measure(view, photon_estimation());
    const auto irradiance = [&](const glm::dvec3& p) { return point_irradiance(key, p); };
    const bool is_virtual = presence == scene::world_mixed;
    const glm::dvec3 with = expected_mean(view, irradiance, true);
    const glm::dvec3 without = expected_mean(view, irradiance, false);
    EXPECT_NEAR((is_virtual ? measured.mixed : measured.real).g, with.g, 0.02 * with.g);
    EXPECT_NEAR((is_virtual ? measured.real : measured.mixed).g, without.g, 1e-3 * without.g);
  }
}

// A lamp that is dimmed in the mixed world throws a dimmer image there, from the same photons.
TEST(MirrorCaustic, OfADimmedLamp) {
  View view = mirror_and_floor();
  view.scene.lights = {key};
  view.scene.lights[0].gain_mixed = 0.25;
  const Measured measured = measure(view, photon_estimation());
  EXPECT_NEAR(measured.mixed.g, 0.25 * measured.real.g, 1e-6 * measured.real.g);
}

// A lamp of another colour throws an image of that colour there, likewise.
TEST(MirrorCaustic, OfATintedLamp) {
  View view = mirror_and_floor();
  set::Light light = key;
  light.tint = {2, 0.5, 0};
  view.scene.lights = {light};
  const Measured measured = measure(view, photon_estimation());
  expect_near(measured.mixed, light.tint * measured.real, 1e-6 * measured.real);
  // The photons bring a good part of it.
  const auto direct = [&](const glm::dvec3& p) { return point_irradiance(light, p); };
  EXPECT_GT(measured.real.g, 1.1 * expected_mean(view, direct, false).g);
}

// A glass ball under a wide lamp: what photons bring is what paths bring that happen to find it, in
// total over the picture. Gathering moves light over a disc, so what the ball hides of the floor
// weighs on the total with the radius over the ball's, squared: 0.5 % of the caustic, itself 2 %.
TEST(GlassCaustic, CarriesAsMuchLightAsTracedPaths) {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(48, 48, 0.8), glm::vec3(0.1f));
  add(view.scene, rectangle_mesh({1, 1}), diffuse(glm::vec3(albedo)));
  add(view.scene, icosphere_mesh(0.1, 3), glass(1.5f), at({0, 0, 0.12}));
  view.scene.lights.push_back(sphere_lamp({0.3, 0, 1}, 0.4, colour));
  // 7 mm, a fourteenth of the ball.
  const Measured by_photons = measure(view, {.photons = 4, .photon_radius_px = 0.3});
  const Measured by_paths = measure(view, {.caustics = set::Caustics::traced});
  const Measured without = measure(view, {.caustics = set::Caustics::none});
  const double error = std::hypot(by_photons.error.g, by_paths.error.g);
  // Photons that are gathered over the edge of the floor or of the ball's foot weigh less than
  // this.
  EXPECT_NEAR(by_photons.mixed.g, by_paths.mixed.g, 4 * error + 5e-4 * by_paths.mixed.g);
  EXPECT_GT(by_paths.mixed.g - without.mixed.g, 20 * error);
}

// A floor in a block of glass: photons enter it and paths leave it, under the same angles outside.
void expect_as_much_light_through(const scene::Material& glass_block) {
  // Nothing is seen beside the block.
  View view = empty_view({0, -0.2, 1}, {0, 0, 0}, pinhole(32, 32, 0.2), glm::vec3(1));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(albedo)));
  add(view.scene, box_mesh({0.36, 0.36, 0.1}), glass_block);
  // The glass, the floor, the glass.
  const Measured by_photons = measure(view, {.max_depth = 3, .photons = 8, .photon_radius_px = 1});
  const Measured by_paths = measure(view, {.max_depth = 3, .caustics = set::Caustics::traced});
  const double error = std::hypot(by_photons.error.g, by_paths.error.g);
  EXPECT_NEAR(by_photons.mixed.g, by_paths.mixed.g, 4 * error);
  EXPECT_LT(error, 7e-3 * by_paths.mixed.g) << "or this would show nothing";
}

// By the angles inside, lacquer would take about 5 % less from the paths.
TEST(LacqueredGlass, CarriesAsMuchLightAsTracedPaths) {
  scene::Material lacquered = glass(1.5f);
  lacquered.clearcoat = 1;
  expect_as_much_light_through(lacquered);
}

// Light leaves under all angles outside, where sheen takes up to nine tenths of it; by the angles
// inside it would take a quarter at most.
TEST(SheenedGlass, CarriesAsMuchLightAsTracedPaths) {
  scene::Material sheened = glass(1.5f);
  sheened.sheen_color = glm::vec3(0.9f);
  sheened.sheen_roughness = 1;
  expect_as_much_light_through(sheened);
}

TEST(Photons, LeaveNoDifferenceWhereTheWorldsAreEqual) {
  View view = mirror_and_floor();
  view.scene.lights = {sphere_lamp(above_floor, 0.2, colour)};
  view.environment = uniform_environment({1, 2, 3});
  const Rendered result = render_view(view, 8);
  for (const glm::vec3& diff : result.layers.diff) EXPECT_EQ(diff, glm::vec3(0));
}

TEST(Photons, GiveTheSamePictureHoweverTheSamplesAreSplit) {
  View view = mirror_and_floor();
  view.scene.lights = {key};
  SetRenderer renderer(view, {.photons = 40, .photon_radius_px = 10});  // many in a bucket
  const auto picture = [&](int first) {
    renderer.begin({{}, 1.0, view.world_from_camera});
    renderer.render(first);
    renderer.render(6 - first);
    return renderer.layers().mixed;
  };
  const auto expected = picture(1);
  EXPECT_EQ(picture(3), expected);
  EXPECT_EQ(picture(5), expected);
}

// A glass bead close to the lens, where it is not seen and takes hardly a photon: the caustic far
// behind it is neither noisier nor smoother. (If its radius followed the nearest glass, here ten
// times nearer, there would be a hundredth of the photons on a disc.)
TEST(PhotonRadius, OfACausticDoesNotDependOnGlassElsewhere) {
  const auto spread_of = [](bool with_bead) {
    View view = mirror_and_floor();
    view.scene.lights = {key};
    if (with_bead) {
      glm::dmat4 behind = view.world_from_camera;
      behind[3] -= 0.1 * behind[2];
      add(view.scene, icosphere_mesh(0.002, 2), glass(1.5f), behind);
    }
    const render::Layers layers = render_clean(view, 4, photon_estimation()).layers;
    return std::pair(mean(layers.mixed).g, standard_error_of_pixels(layers));
  };
  const auto [alone, alone_error] = spread_of(false);
  const auto [beside, beside_error] = spread_of(true);
  EXPECT_NEAR(beside, alone, 4 * std::hypot(alone_error, beside_error));
  // The spread of 256 pixels is itself known to a sixteenth over the root of two.
  EXPECT_NEAR(beside_error / alone_error, 1, 4 / std::sqrt(256.0));
}

TEST(PhotonRadius, ShrinksByTheRuleOfProgressivePhotonMapping) {
  EXPECT_NEAR(render::photon_radius_factor(0), 1, 1e-12);
  for (const std::uint64_t pass : {1u, 2u, 10u, 1000u}) {
    const double ratio =
        render::photon_radius_factor(pass) / render::photon_radius_factor(pass - 1);
    const auto n = static_cast<double>(pass);
    EXPECT_NEAR(ratio * ratio, (n + 2.0 / 3) / (n + 1), 1e-9);
  }
}

TEST(PhotonCount, IsKeptWithinWhatAPassCanHold) {
  EXPECT_EQ(render::photon_count(0.1, 640, 480, 131072), 30720u);
  EXPECT_EQ(render::photon_count(0.001, 16, 16, 131072), 1024u);
  EXPECT_EQ(render::photon_count(10, 8192, 4320, 131072), 131072u);
}

}  // namespace previz::test::caustic_test
