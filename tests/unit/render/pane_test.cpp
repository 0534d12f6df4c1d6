// Smooth thin panes: light goes straight through them, in shadow rays, paths and photons alike.
#include "tests/support/render_fixture.hpp"
#include "tests/truth/cpu_bsdf.hpp"

namespace previz::test::pane_test {

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.6;

const glm::dvec3 colour(2, 3, 5);
const glm::dvec3 tint(0.9, 0.6, 0.2);

// What a clear pane lets through: the unpolarised reflectance R of one side, and between both sides
// R' = 2 R / (1 + R).
double transmittance(double cosine, double ior) {
  const double once = truth::fresnel_dielectric(cosine, ior);
  return 1 - 2 * once / (1 + once);
}

// Returns the share of an even light that passes: 2 times the integral of T(c) c over the cosine.
double mean_transmittance() {
  constexpr int steps = 1000;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double cosine = (i + 0.5) / steps;
    sum += 2 * transmittance(cosine, 1.5) * cosine / steps;
  }
  return sum;
}

// A pane 5 cm above the lit point, wider than all that light comes by; the camera looks under it.
// What is exactly on the edge that its two triangles share meets both, and passes twice: with
// coordinates of 2 km, which are known to 0.1 mm, a few rays in a thousand. So the edge is
// elsewhere.
View under_a_pane(const scene::Material& material, std::uint32_t presence = scene::world_both) {
  View view = lit_point(albedo);
  view.world_from_camera = look_at({0, -1, 0.03}, {0, 0, 0});
  add(view.scene, rectangle_mesh({2000, 2000}), material, at({300, 0, 0.05}), presence);
  return view;
}

const set::Light key = point_lamp({1, 1, 2}, colour);

// The lamp through the pane, however caustics are brought, and by either estimator. One bounce, so
// that the pane mirrors nothing of the floor.
TEST(Pane, LetsALampThroughByItsTransmittance) {
  View view = under_a_pane(pane(tint));
  view.scene.lights.push_back(key);
  const double d2 = 6, cosine = 2 / std::sqrt(d2);
  const glm::dvec3 expected =
      albedo / pi * colour * tint * (transmittance(cosine, 1.5) * cosine / d2);
  for (const auto caustics : {set::Caustics::none, set::Caustics::photons, set::Caustics::traced}) {
    const Rendered result = render_clean(view, 4, {.max_depth = 1, .caustics = caustics});
    expect_near(mean(result.layers.mixed) / expected, glm::dvec3(1), 1e-3);
    EXPECT_EQ(mean(result.layers.diff), glm::dvec3(0));
  }
}

// A virtual pane dims the light by what it keeps, a removed one gives that back.
TEST(Pane, OfOneWorldMakesTheDifferenceThatItKeeps) {
  const double d2 = 6, cosine = 2 / std::sqrt(d2);
  const glm::dvec3 clear = albedo / pi * colour * (cosine / d2);
  for (const std::uint32_t presence : {scene::world_mixed, scene::world_real}) {
    View view = under_a_pane(pane(tint), presence);
    view.scene.lights.push_back(key);
    const double sign = presence == scene::world_mixed ? 1 : -1;
    for (const auto estimator : both_estimators) {
      const Rendered result = render_clean(view, 4, up_to_depth(1, estimator));
      const glm::dvec3 kept = tint * transmittance(cosine, 1.5) - 1.0;
      expect_near(mean(result.layers.diff) / clear, sign * kept, 1e-3);
    }
  }
}

// An even sky of 1 through a pane: by light samples, by the BSDF alone, and whether caustics are
// traced or left out.
TEST(Pane, LetsAnEvenSkyThroughByItsTransmittance) {
  View view = under_a_pane(pane(tint));
  view.environment = uniform_environment(glm::vec3(1));
  const double through = mean_transmittance();
  for (const auto sampling : {set::LightSampling::importance, set::LightSampling::bsdf}) {
    for (const auto caustics :
         {set::Caustics::none, set::Caustics::photons, set::Caustics::traced}) {
      const Rendered result =
          render_clean(view, 64, {.max_depth = 1, .caustics = caustics}, sampling);
      const double error = standard_error_of_pixels(result.layers) / (albedo * through * tint.g);
      expect_near(mean(result.layers.mixed) / (albedo * through * tint), glm::dvec3(1),
                  4 * error + 1e-3);
    }
  }
}

// What the floor sees of itself in a pane comes by paths, and is there once: floor, pane, floor.
TEST(Pane, MirrorsTheFloorBelowIt) {
  View view = under_a_pane(pane());
  view.environment = uniform_environment(glm::vec3(1));
  const Rendered result =
      render_clean(view, 256, {.max_depth = 3, .caustics = set::Caustics::none});
  const double through = mean_transmittance(), mirrored = 1 - through;
  // The pane's mirror image of the floor, lit by the sky through the pane; all of the floor that is
  // seen in it at less than 89.7 degrees is within its 10 m.
  const double expected = albedo * through * (1 + albedo * mirrored);
  EXPECT_NEAR(mean(result.layers.mixed).g / expected, 1,
              4 * standard_error_of_pixels(result.layers) / expected + 2e-3);
}

// A virtual wall close behind a pane takes nothing of the real world: a ray that forks at the wall
// goes on behind the pane, through which it has passed already.
TEST(Pane, IsPassedOnceByARayThatForksCloseBehindIt) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(16, 16, 0.3), glm::vec3(1));
  const auto wall = add_mesh(view.scene, rectangle_mesh({4, 4}));
  add_instance(view.scene, wall, add_material(view.scene, pane(tint)));
  // It is 5e-5 of the ray's length behind the pane.
  add_instance(view.scene, wall, add_material(view.scene, diffuse(glm::vec3(0))), at({0, 0, -5e-5}),
               scene::world_mixed);
  const Rendered result = render_clean(view, 64, up_to_depth(1));
  const double through = transmittance(1, 1.5);
  const double error = standard_error_of_pixels(result.layers) + 2e-3;
  expect_near(mean(result.layers.real), tint * through + 1.0 - through, 4 * error);
  expect_near(mean(result.layers.mixed), glm::dvec3(1 - through), 4 * error);
}

// A mirror beside the floor, and the lamp in a bubble of tinted air that bends nothing: direct
// light and the mirror's image, which photons bring, are dimmed by the tint to the last photon's
// noise.
TEST(Pane, LetsPhotonsThroughByItsTint) {
  View view = empty_view({0, -0.4, 1}, {0, 0, 0}, pinhole(16, 16, 0.3));
  add(view.scene, rectangle_mesh({1, 1}), diffuse(glm::vec3(albedo)));
  glm::dmat4 pose(1);
  pose[0] = {0, 0, 1, 0};
  pose[2] = {-1, 0, 0, 0};
  pose[3] = {1, 0, 1, 1};
  add(view.scene, rectangle_mesh({2, 2}), metal(glm::vec3(1), 0), pose);
  set::Light light = sphere_lamp({0.2, 0.3, 1.2}, 0.1, colour);
  view.scene.lights.push_back(light);
  const set::Estimation estimation{.max_depth = 2, .photons = 20, .photon_radius_px = 2};
  const auto of = [&](const View& lit) {
    SetRenderer renderer(lit, estimation);
    std::vector<glm::dvec3> means;
    for (std::uint32_t i = 0; i < 16; ++i)
      means.push_back(mean(renderer.rendered_clean(8, 100 + i).mixed));
    return estimate_of(means);
  };
  const auto [clear, clear_error] = of(view);
  for (const glm::dvec3& bubble_tint : {glm::dvec3(0.5), tint}) {
    View tinted = view;
    add(tinted.scene, icosphere_mesh(0.15, 3), pane(bubble_tint, 1.0f), at(light.position));
    const auto [dimmed, error] = of(tinted);
    expect_near(dimmed, bubble_tint * clear, 4.0 * (error + bubble_tint * clear_error));
  }
}

}  // namespace previz::test::pane_test
