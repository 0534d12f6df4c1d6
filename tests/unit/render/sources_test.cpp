// Light sources taken out of the environment light a scene as they did within it.
#include "daemon/core/lighting/light_mode.hpp"
#include "daemon/core/lighting/source_tracker.hpp"
#include "shaders/lib/render_shared.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::sources_test {

constexpr double degree = 0.017453292519943295;

// A lamp of 3 degrees at 50 degrees of elevation over a grey sky that is brighter to one side.
lighting::EnvironmentMap lamp_and_sky() {
  lighting::EnvironmentMap map{128, {}};
  const glm::vec3 lamp(0, std::cos(50 * degree), std::sin(50 * degree));
  for (int j = 0; j < map.size; ++j)
    for (int i = 0; i < map.size; ++i) {
      const glm::vec3 direction = lighting::texel_direction(map.size, i, j);
      const bool on = glm::dot(direction, lamp) > std::cos(3 * degree);
      map.radiance.emplace_back(on ? glm::vec3(200, 150, 100)
                                   : glm::vec3(0.3f + 0.1f * direction.x));
    }
  return map;
}

// A real floor and a virtual ball that stands on it.
View ball_on_floor() {
  View view = empty_view({0, -1.2, 0.8}, {0, 0, 0.1}, pinhole(32, 24, 0.7));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.6)));
  add(view.scene, icosphere_mesh(0.2, 3), diffuse(glm::vec3(0.8)), at({0, 0, 0.2}),
      scene::world_mixed);
  view.environment = lamp_and_sky();
  return view;
}

struct Lit {
  lighting::EnvironmentMap environment;
  std::vector<set::Light> lamps;
};

Lit split(const lighting::EnvironmentMap& map, set::LightMode mode) {
  lighting::Lighting lighting;
  lighting.environment = map;
  set::Lighting settings;
  settings.mode = mode;
  lighting::SourceTracker tracker(0);
  lighting::apply_mode(lighting, settings, tracker, 0);
  return {lighting.environment,
          lighting::lamps_of(lighting.sources, glm::dvec3(0),
                             [](const glm::dvec3&) { return std::optional<double>(); })};
}

class SourceLight : public ::testing::Test {
 protected:
  explicit SourceLight(const View& view = ball_on_floor()) : view_(view), renderer_(view) {}
  render::Layers rendered(const Lit& lit, int samples, std::uint32_t seed = 1) {
    renderer_.set_environment(lit.environment, set::LightSampling::importance);
    renderer_.set_sources(lit.lamps);
    return renderer_.rendered_clean(samples, seed);
  }

  const View view_;
  SetRenderer renderer_;
};

// Means over the picture of 8 independent renderings each, within 4 standard errors of their
// difference. What may be left is the lamp's outline: the map's texels of 1.6 degrees and their
// bilinear interpolation, against a disc. Neither moves the picture's mean of light or shadow by
// more than a share of the penumbra's own size, 6 degrees of a radian: 0.5 % of the mean.
TEST_F(SourceLight, LightsAsTheImageItWasTakenOutOf) {
  struct Means {
    Estimate mixed, difference;
  };
  const auto means = [&](const Lit& lit) {
    std::vector<glm::dvec3> mixed, difference;
    for (std::uint32_t run = 0; run < 8; ++run) {
      const render::Layers layers = rendered(lit, 32, 100 + run);
      mixed.push_back(mean(layers.mixed));
      difference.push_back(mean(layers.diff));
    }
    return Means{estimate_of(mixed), estimate_of(difference)};
  };
  const auto expect_same = [](const Estimate& found, const Estimate& expected) {
    EXPECT_NEAR(
        found.mean.g, expected.mean.g,
        4 * std::hypot(found.error.g, expected.error.g) + 0.005 * std::abs(expected.mean.g));
  };
  const Means image = means({view_.environment, {}});
  for (const set::LightMode mode : {set::LightMode::hybrid, set::LightMode::sources}) {
    const Means split_up = means(split(view_.environment, mode));
    SCOPED_TRACE(mode == set::LightMode::hybrid ? "hybrid" : "sources");
    expect_same(split_up.mixed, image.mixed);
    expect_same(split_up.difference, image.difference);
  }
}

// A lamp that goes out between two frames is gone in the next, with the pipelines of the first.
TEST_F(SourceLight, GoesOutBetweenFramesWithTheSamePipelines) {
  Lit lit = split(view_.environment, set::LightMode::sources);
  lit.environment = uniform_environment(glm::vec3(0));
  EXPECT_GT(mean(rendered(lit, 2).mixed).g, 0);
  EXPECT_EQ(mean(rendered({lit.environment, {}}, 2).mixed), glm::dvec3(0));
  EXPECT_NE(renderer_.needed() & gpu::FEATURE_LIGHTS, 0u);
  EXPECT_NE(renderer_.needed() & gpu::FEATURE_VISIBLE_LIGHTS, 0u);
  EXPECT_GT(mean(rendered(lit, 2).mixed).g, 0);
}

}  // namespace previz::test::sources_test
