// Smooth thin panes: light goes straight through them, in shadow rays, paths and photons alike.
#include <numbers>

#include "tests/support/render_fixture.hpp"

namespace previz::test::pane_test {

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.6;

const glm::dvec3 colour(2, 3, 5);
const glm::dvec3 tint(0.9, 0.6, 0.2);

scene::Material pane(float ior, const glm::dvec3& tint_of_pane) {
  scene::Material material = glass(ior);
  material.thin_walled = true;
  material.base_color = glm::vec3(tint_of_pane);
  return material;
}

// What a clear pane lets through: the unpolarised reflectance R of one side, and between both sides
// R' = 2 R / (1 + R).
double transmittance(double cosine, double ior) {
  const double behind = std::sqrt(1 - (1 - cosine * cosine) / (ior * ior));
  const double p = (ior * cosine - behind) / (ior * cosine + behind);
  const double s = (cosine - ior * behind) / (cosine + ior * behind);
  const double once = 0.5 * (p * p + s * s);
  return 1 - 2 * once / (1 + once);
}

// A pane 5 cm above the lit point, wider than all that light comes by; the camera looks under it.
// What is exactly on the edge that its two triangles share meets both, and passes twice: with
// coordinates of 2 km, which are known to 0.1 mm, a few rays in a thousand. So the edge is
// elsewhere.
View under_a_pane(const scene::Material& material, std::uint32_t presence = scene::world_both) {
  View view = lit_point(albedo);
  view.world_from_camera = look_at({0, -1, 0.03}, {0, 0, 0});
  glm::dmat4 above(1);
  above[3] = {300, 0, 0.05, 1};
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({2000, 2000})),
               add_material(view.scene, material), above, presence);
  return view;
}

set::Light point_lamp() {
  set::Light light = lamp(set::LightType::point, colour);
  light.position = {1, 1, 2};
  return light;
}

// The lamp through the pane, however caustics are brought, and by either estimator. One bounce, so
// that the pane mirrors nothing of the floor.
TEST(Pane, LetsALampThroughByItsTransmittance) {
  View view = under_a_pane(pane(1.5f, tint));
  view.scene.lights.push_back(point_lamp());
  const double d2 = 6, cosine = 2 / std::sqrt(d2);
  const glm::dvec3 expected =
      albedo / pi * colour * tint * (transmittance(cosine, 1.5) * cosine / d2);
  for (const auto caustics : {set::Caustics::none, set::Caustics::photons, set::Caustics::traced}) {
    set::Estimation estimation = up_to_depth(1);
    estimation.caustics = caustics;
    const Rendered result = render_clean(view, 4, estimation);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(mean(result.layers.mixed)[c] / expected[c], 1, 1e-3) << "channel " << c;
    EXPECT_EQ(mean(result.layers.diff), glm::dvec3(0));
  }
}

// A virtual pane dims the light by what it keeps, a removed one gives that back.
TEST(Pane, OfOneWorldMakesTheDifferenceThatItKeeps) {
  const double d2 = 6, cosine = 2 / std::sqrt(d2);
  const glm::dvec3 clear = albedo / pi * colour * (cosine / d2);
  for (const std::uint32_t presence : {scene::world_mixed, scene::world_real}) {
    View view = under_a_pane(pane(1.5f, tint), presence);
    view.scene.lights.push_back(point_lamp());
    const double sign = presence == scene::world_mixed ? 1 : -1;
    for (const auto estimator : {set::Estimator::paired, set::Estimator::difference}) {
      set::Estimation estimation = up_to_depth(1);
      estimation.estimator = estimator;
      const Rendered result = render_clean(view, 4, estimation);
      for (int c = 0; c < 3; ++c) {
        const double kept = tint[c] * transmittance(cosine, 1.5) - 1;
        EXPECT_NEAR(mean(result.layers.diff)[c] / clear[c], sign * kept, 1e-3) << "channel " << c;
      }
    }
  }
}

// An even sky of 1 through a pane: by light samples, by the BSDF alone, and whether caustics are
// traced or left out, 2 times the integral of T(c) c over the cosine.
TEST(Pane, LetsAnEvenSkyThroughByItsTransmittance) {
  View view = under_a_pane(pane(1.5f, tint));
  view.environment = uniform_environment(glm::vec3(1));
  double through = 0;
  constexpr int steps = 1000;
  for (int i = 0; i < steps; ++i) {
    const double cosine = (i + 0.5) / steps;
    through += 2 * transmittance(cosine, 1.5) * cosine / steps;
  }
  for (const auto sampling : {set::LightSampling::importance, set::LightSampling::bsdf}) {
    for (const auto caustics :
         {set::Caustics::none, set::Caustics::photons, set::Caustics::traced}) {
      set::Estimation estimation = up_to_depth(1);
      estimation.caustics = caustics;
      const Rendered result = render_clean(view, 64, estimation, sampling);
      const double error = standard_error_of_pixels(result.layers) / (albedo * through * tint.g);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(mean(result.layers.mixed)[c] / (albedo * through * tint[c]), 1,
                    4 * error + 1e-3)
            << "channel " << c;
    }
  }
}

// What the floor sees of itself in a pane comes by paths, and is there once: floor, pane, floor.
TEST(Pane, MirrorsTheFloorBelowIt) {
  View view = under_a_pane(pane(1.5f, glm::dvec3(1)));
  view.environment = uniform_environment(glm::vec3(1));
  set::Estimation estimation = up_to_depth(3);
  estimation.caustics = set::Caustics::none;
  const Rendered result = render_clean(view, 256, estimation);
  double through = 0, mirrored = 0;
  constexpr int steps = 1000;
  for (int i = 0; i < steps; ++i) {
    const double cosine = (i + 0.5) / steps;
    through += 2 * transmittance(cosine, 1.5) * cosine / steps;
    mirrored += 2 * (1 - transmittance(cosine, 1.5)) * cosine / steps;
  }
  // The pane's mirror image of the floor, lit by the sky through the pane; all of the floor that is
  // seen in it at less than 89.7 degrees is within its 10 m.
  const double expected = albedo * through * (1 + albedo * mirrored);
  EXPECT_NEAR(mean(result.layers.mixed).g / expected, 1,
              4 * standard_error_of_pixels(result.layers) / expected + 2e-3);
}

// A virtual wall close behind a pane takes nothing of the real world: a ray that forks at the wall
// goes on behind the pane, through which it has passed already.
TEST(Pane, IsPassedOnceByARayThatForksCloseBehindIt) {
  View view;
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(16, 16, 0.3);
  view.world_from_camera = look_at({0, 0, 1}, {0, 0, 0});
  const auto wall = add_mesh(view.scene, rectangle_mesh({4, 4}));
  add_instance(view.scene, wall, add_material(view.scene, pane(1.5f, tint)));
  glm::dmat4 behind(1);
  behind[3].z = -5e-5;  // of the ray's length, which is 1
  add_instance(view.scene, wall, add_material(view.scene, diffuse(glm::vec3(0))), behind,
               scene::world_mixed);
  const Rendered result = render_clean(view, 64, up_to_depth(1));
  const double through = transmittance(1, 1.5);
  const double error = standard_error_of_pixels(result.layers) + 2e-3;
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(mean(result.layers.real)[c], tint[c] * through + 1 - through, 4 * error);
    EXPECT_NEAR(mean(result.layers.mixed)[c], 1 - through, 4 * error);
  }
}

// A mirror beside the floor, and the lamp in a bubble of tinted air that bends nothing: direct
// light and the mirror's image, which photons bring, are dimmed by the tint to the last photon's
// noise.
TEST(Pane, LetsPhotonsThroughByItsTint) {
  View view;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({1, 1})),
               add_material(view.scene, diffuse(glm::vec3(albedo))));
  glm::dmat4 pose(1);
  pose[0] = {0, 0, 1, 0};
  pose[2] = {-1, 0, 0, 0};
  pose[3] = {1, 0, 1, 1};
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({2, 2})),
               add_material(view.scene, metal(glm::vec3(1), 0)), pose);
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = pinhole(16, 16, 0.3);
  view.world_from_camera = look_at({0, -0.4, 1}, {0, 0, 0});
  set::Light light = lamp(set::LightType::sphere, colour);
  light.position = {0.2, 0.3, 1.2};
  light.radius_m = 0.1;
  view.scene.lights.push_back(light);
  set::Estimation estimation = up_to_depth(2);
  estimation.photons = 20;
  estimation.photon_radius_px = 2;
  const auto of = [&](const View& lit) {
    glm::dvec3 sum(0), squares(0);
    constexpr int scrambles = 16;
    SetRenderer renderer(lit, estimation);
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer.begin({{}, 1.0, lit.world_from_camera, 100 + i});
      renderer.render(8);
      expect_clean(renderer.counters());
      const glm::dvec3 picture = mean(renderer.layers().mixed);
      sum += picture / static_cast<double>(scrambles);
      squares += picture * picture / static_cast<double>(scrambles);
    }
    return std::pair(sum, glm::sqrt(glm::max(squares - sum * sum, 0.0) / (scrambles - 1.0)));
  };
  const auto [clear, clear_error] = of(view);
  glm::dmat4 around(1);
  around[3] = glm::dvec4(light.position, 1);
  for (const glm::dvec3& bubble_tint : {glm::dvec3(0.5), tint}) {
    View tinted = view;
    add_instance(tinted.scene, add_mesh(tinted.scene, icosphere_mesh(0.15, 3)),
                 add_material(tinted.scene, pane(1.0f, bubble_tint)), around);
    const auto [dimmed, error] = of(tinted);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(dimmed[c], bubble_tint[c] * clear[c],
                  4 * (error[c] + bubble_tint[c] * clear_error[c]))
          << "channel " << c;
  }
}

}  // namespace previz::test::pane_test
