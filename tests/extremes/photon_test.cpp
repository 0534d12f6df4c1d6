// Photons after a million passes, photons that never arrive, and radii of nothing.
#include "daemon/render/device.hpp"
#include "daemon/render/photon_schedule.hpp"
#include "tests/extremes/every_way.hpp"

namespace previz::test::photon_test {

// A diffuse floor with a glass ball over it under a lamp.
View caustic_set() {
  View view;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({1, 1})),
               add_material(view.scene, diffuse(glm::vec3(0.6f))));
  glm::dmat4 pose(1);
  pose[3] = {0, 0, 0.25, 1};
  add_instance(view.scene, add_mesh(view.scene, icosphere_mesh(0.1, 3)),
               add_material(view.scene, glass(1.5f)), pose, scene::world_mixed);
  set::Light lamp;
  lamp.position = {0.1, 0.1, 1.5};
  lamp.gain_real = 1;
  view.scene.lights.push_back(lamp);
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = pinhole(24, 24, 0.5);
  view.world_from_camera = look_at({0, -0.6, 0.6}, {0, 0, 0});
  return view;
}

set::Estimation photons_of_radius(double pixels) {
  set::Estimation estimation = up_to_depth(6);
  estimation.caustics = set::Caustics::photons;
  estimation.photons = 10;
  estimation.photon_radius_px = pixels;
  return estimation;
}

// The product of the rule's steps is Gamma(n + 5/3) / (Gamma(5/3) Gamma(n + 2)), which a million
// and ten million multiplications confirm; it neither reaches 0 nor stops shrinking.
TEST(ExtremePhotons, TheRadiusAfterAMillionPassesIsTheRules) {
  double squared = 1;
  double last = 1;
  for (std::uint64_t pass = 1; pass <= 10'000'000; ++pass) {
    const auto n = static_cast<double>(pass);
    squared *= (n + 2.0 / 3) / (n + 1);
    if (pass == 1'000'000 || pass == 10'000'000) {
      const double factor = render::photon_radius_factor(pass);
      // lgamma of 1e7 is 1.5e8, of which double precision leaves 3e-8.
      EXPECT_NEAR(factor / std::sqrt(squared), 1, 1e-7);
      EXPECT_LT(factor, last);
      last = factor;
    }
  }
  EXPECT_GT(render::photon_radius_factor(0xffffffff), 0);
}

// The lamp shines on the real table; over a black plate the difference estimator's picture is what
// the ball changes.
class PhotonsByEveryWay : public EveryWay {
 protected:
  static render::Layers show(const View& view, int samples, const set::Estimation& estimation) {
    static const Seen nothing{{24, 24, 16, std::vector<std::uint16_t>(3 * 24 * 24)}, 1};
    return render_by(GetParam(), view, nothing, samples, estimation).layers;
  }
};
INSTANTIATE_TEST_SUITE_P(Ways, PhotonsByEveryWay, testing::Values(paired, difference, by_camera),
                         name_of_way);

// What a million passes leave of the radius, and what is left after far more: finite, even where no
// disc holds a photon any more.
TEST_P(PhotonsByEveryWay, AShrunkRadiusIsFinite) {
  const View view = caustic_set();
  for (const double shrunk : {0.1, 1e-6, 1e-30}) {
    const render::Layers layers = show(view, 8, photons_of_radius(2 * shrunk));
    for (const glm::vec3& pixel : layers.mixed)
      for (int c = 0; c < 3; ++c) ASSERT_TRUE(std::isfinite(pixel[c])) << shrunk;
  }
}

// A tenth of the radius finds a hundredth of the photons in each disc, and no less light in all.
// What is still blurred over the picture's edge is the same by four standard errors over the seeds.
TEST(ExtremePhotons, ASmallerRadiusLosesNoLight) {
  const View view = caustic_set();
  constexpr int seeds = 6;
  double sum = 0, squares = 0;
  for (std::uint32_t seed = 1; seed <= seeds; ++seed) {
    const auto light = [&](double radius_px) {
      set::Estimation estimation = photons_of_radius(radius_px);
      estimation.seed = seed;
      return mean(render_clean(view, 4, estimation).layers.mixed).g;
    };
    const double change = light(0.2) / light(2) - 1;
    sum += change;
    squares += change * change;
  }
  const double centre = sum / seeds;
  const double error = std::sqrt((squares / seeds - centre * centre) / (seeds - 1));
  EXPECT_LT(std::abs(centre), 4 * error);
  EXPECT_LT(error, 0.01) << "nothing was shown";
}

// The lamp shines away from all glass, or is black, or the ball is where no photon can reach it:
// nothing is stored, nothing is divided by it.
TEST_P(PhotonsByEveryWay, NoneStoredIsNoCaustic) {
  View away = caustic_set();
  away.scene.lights[0].type = set::LightType::spot;
  away.scene.lights[0].direction = {0, 0, 1};
  away.scene.lights[0].outer_cone_rad = 0.2;
  View black = caustic_set();
  black.scene.lights[0].emission = glm::dvec3(0);
  for (const View& view : {away, black}) {
    EXPECT_EQ(mean(show(view, 4, photons_of_radius(2)).mixed), glm::dvec3(0));
  }
  View hidden = caustic_set();
  glm::dmat4 pose(1);
  pose[3] = {0, 0, 0.25, 1};
  add_instance(hidden.scene, add_mesh(hidden.scene, box_mesh({0.3, 0.3, 0.3})),
               add_material(hidden.scene, diffuse(glm::vec3(0.6f))), pose, scene::world_mixed);
  set::Estimation none = photons_of_radius(2);
  none.caustics = set::Caustics::none;
  EXPECT_EQ(show(hidden, 4, photons_of_radius(2)).mixed, show(hidden, 4, none).mixed);
}

}  // namespace previz::test::photon_test
