// Photons after a million passes, photons that never arrive, and radii of nothing.
#include "daemon/core/render/device/device.hpp"
#include "daemon/core/render/passes/photon_schedule.hpp"
#include "tests/extremes/every_way.hpp"

namespace previz::test::photon_test {

// A diffuse floor with a glass ball over it under a lamp.
View caustic_set() {
  View view = empty_view({0, -0.6, 0.6}, {0, 0, 0}, pinhole(24, 24, 0.5));
  add(view.scene, rectangle_mesh({1, 1}), diffuse(glm::vec3(0.6f)));
  add(view.scene, icosphere_mesh(0.1, 3), glass(1.5f), at({0, 0, 0.25}), scene::world_mixed);
  view.scene.lights = {point_lamp({0.1, 0.1, 1.5})};
  return view;
}

set::Estimation photons_of_radius(double pixels) {
  return {.max_depth = 6,
          .caustics = set::Caustics::photons,
          .photons = 10,
          .photon_radius_px = pixels};
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
  std::vector<glm::dvec3> changes;
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    const auto light = [&](double radius_px) {
      set::Estimation estimation = photons_of_radius(radius_px);
      estimation.seed = seed;
      return mean(render_clean(view, 4, estimation).layers.mixed).g;
    };
    changes.emplace_back(light(0.2) / light(2) - 1);
  }
  const auto [change, error] = estimate_of(changes);
  EXPECT_LT(std::abs(change.g), 4 * error.g);
  EXPECT_LT(error.g, 0.01) << "nothing was shown";
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
  for (const View& view : {away, black})
    EXPECT_EQ(mean(show(view, 4, photons_of_radius(2)).mixed), glm::dvec3(0));
  View hidden = caustic_set();
  add(hidden.scene, box_mesh({0.3, 0.3, 0.3}), diffuse(glm::vec3(0.6f)), at({0, 0, 0.25}),
      scene::world_mixed);
  set::Estimation none = photons_of_radius(2);
  none.caustics = set::Caustics::none;
  EXPECT_EQ(show(hidden, 4, photons_of_radius(2)).mixed, show(hidden, 4, none).mixed);
}

}  // namespace previz::test::photon_test
