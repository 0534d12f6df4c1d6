// Light sources taken out of the environment light a scene as they did within it.
#include "daemon/lighting/light_mode.hpp"
#include "daemon/lighting/source_tracker.hpp"
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
  View view;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({2, 2})),
               add_material(view.scene, diffuse(glm::vec3(0.6))));
  glm::dmat4 up(1.0);
  up[3].z = 0.2;
  add_instance(view.scene, add_mesh(view.scene, icosphere_mesh(0.2, 3)),
               add_material(view.scene, diffuse(glm::vec3(0.8))), up, scene::world_mixed);
  view.calibration = pinhole(32, 24, 0.7);
  view.world_from_camera = look_at({0, -1.2, 0.8}, {0, 0, 0.1});
  view.environment = lamp_and_sky();
  return view;
}

struct Lit {
  lighting::EnvironmentMap environment;
  std::vector<set::Light> lamps;
};

Lit split(const lighting::EnvironmentMap& map, set::LightMode mode,
          std::optional<double> distance_m = {}) {
  lighting::Lighting lighting;
  lighting.environment = map;
  set::Lighting settings;
  settings.mode = mode;
  lighting::SourceTracker tracker(0);
  lighting::apply_mode(lighting, settings, tracker, 0);
  return {lighting.environment, lighting::lamps_of(lighting.sources, glm::dvec3(0),
                                                   [=](const glm::dvec3&) { return distance_m; })};
}

class SourceLight : public ::testing::Test {
 protected:
  explicit SourceLight(const View& view = ball_on_floor())
      : view_(view), renderer_(shared_device(), set::Estimation{}, view.calibration) {
    renderer_.set_scene(view.scene);
  }
  render::Layers rendered(const Lit& lit, int samples, std::uint32_t seed = 1) {
    renderer_.set_environment(lit.environment, set::LightSampling::importance);
    renderer_.set_sources(lit.lamps);
    render::FrameInput frame;
    frame.world_from_camera = view_.world_from_camera;
    frame.seed = seed;
    renderer_.begin(frame);
    renderer_.render(samples);
    expect_clean(renderer_.counters());
    return renderer_.layers();
  }

  const View view_;
  render::Renderer renderer_;
};

// Means over the picture of 8 independent renderings each, within 4 standard errors of their
// difference. What may be left is the lamp's outline: the map's texels of 1.6 degrees and their
// bilinear interpolation, against a disc. Neither moves the picture's mean of light or shadow by
// more than a share of the penumbra's own size, 6 degrees of a radian: 0.5 % of the mean.
TEST_F(SourceLight, LightsAsTheImageItWasTakenOutOf) {
  constexpr int runs = 8;
  const auto means = [&](const Lit& lit) {
    std::vector<std::array<double, 2>> result;
    for (std::uint32_t run = 0; run < runs; ++run) {
      const render::Layers layers = rendered(lit, 32, 100 + run);
      result.push_back({mean(layers.mixed).g, mean(layers.diff).g});
    }
    return result;
  };
  const auto image = means({view_.environment, {}});
  for (const set::LightMode mode : {set::LightMode::hybrid, set::LightMode::sources}) {
    const auto split_up = means(split(view_.environment, mode));
    for (std::size_t layer = 0; layer < 2; ++layer) {
      const auto of = [&](const auto& values) {
        double sum = 0, squares = 0;
        for (const auto& value : values) sum += value[layer] / runs;
        for (const auto& value : values) squares += (value[layer] - sum) * (value[layer] - sum);
        return std::pair(sum, squares / (runs * (runs - 1)));
      };
      const auto [expected, variance] = of(image);
      const auto [found, other_variance] = of(split_up);
      EXPECT_NEAR(found, expected,
                  4 * std::sqrt(variance + other_variance) + 0.005 * std::abs(expected))
          << (layer == 0 ? "mixed" : "difference");
    }
  }
}

// A sphere 100 times as far off as the scene is wide lights it like the distant disc.
TEST_F(SourceLight, FarAwayASphereIsADisc) {
  const Lit disc = split(view_.environment, set::LightMode::hybrid);
  const Lit sphere = split(view_.environment, set::LightMode::hybrid, 100.0);
  ASSERT_EQ(sphere.lamps.front().type, set::LightType::sphere);
  // The ball's 0.4 m at 100 m: half a percent of distance, one of flux.
  EXPECT_NEAR(mean(rendered(sphere, 64).mixed).g / mean(rendered(disc, 64).mixed).g, 1, 0.02);
}

// The light is the same in both worlds, so nothing is put onto the plate where nothing is virtual.
TEST_F(SourceLight, WithoutAVirtualObjectTheDifferenceIsZero) {
  View view = ball_on_floor();
  view.scene.instances.pop_back();
  renderer_.set_scene(view.scene);
  for (const glm::vec3& pixel : rendered(split(view_.environment, set::LightMode::hybrid), 4).diff)
    EXPECT_EQ(pixel, glm::vec3(0));
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
