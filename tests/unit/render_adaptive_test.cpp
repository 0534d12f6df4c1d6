// Adaptive sampling: the estimated error is the true one, and samples go where it is.
#include "daemon/pipeline/refinement.hpp"
#include "daemon/render/error_estimate.hpp"
#include "tests/unit/render_fixture.hpp"

namespace previz::testing {
namespace {

View small_set() {
  RandomScene options;
  options.width = 64;
  options.height = 48;
  return random_scene(2, options);
}

struct SetRenderer : render::Renderer {
  explicit SetRenderer(const View& view) : render::Renderer(shared_device(), {}, view.calibration) {
    set_scene(view.scene);
    set_environment(view.environment, set::LightSampling::importance);
  }
};

double rms_difference(const render::Layers& a, const render::Layers& b) {
  double sum = 0, square = 0;
  for (std::size_t i = 0; i < a.composite.size(); ++i) {
    const glm::dvec3 difference(a.composite[i] - b.composite[i]);
    const glm::dvec3 value(b.composite[i]);
    sum += glm::dot(difference, difference);
    square += glm::dot(value, value);
  }
  return std::sqrt(sum / square);
}

set::Quality quality(int samples, double error, double seconds = 0) {
  set::Quality result;
  result.samples = samples;
  result.error = error;
  result.seconds = seconds;
  return result;
}

// Two runs with other random numbers differ by sqrt(2) times the error of each; stratification
// makes the true error the smaller one.
TEST(Adaptive, the_estimate_is_the_true_error_or_above) {
  const View view = small_set();
  SetRenderer renderer(view);
  std::vector<render::Layers> layers;
  for (const std::uint32_t seed : {1u, 2u}) {
    renderer.begin({{}, 1.0, view.world_from_camera, seed});
    renderer.render(64);
    layers.push_back(renderer.layers());
  }
  const double truth = rms_difference(layers[0], layers[1]) / std::sqrt(2.0);
  const double estimate = render::estimate_error(layers[0]).picture;
  EXPECT_GT(estimate, 0.8 * truth);
  EXPECT_LT(estimate, 3 * truth);
}

TEST(Adaptive, reaches_the_error_with_fewer_samples_than_even_sampling) {
  const View view = small_set();
  SetRenderer renderer(view);
  const double target = 0.2;
  renderer.begin({{}, 1.0, view.world_from_camera});
  const auto refined = pipeline::refine(renderer, quality(8, target), {}, {});
  EXPECT_TRUE(refined.whole);
  EXPECT_LE(refined.error, target);
  expect_clean(renderer.counters());
  const auto rays = renderer.counters().rays;
  const render::ErrorEstimate adaptive = render::estimate_error(renderer.layers());
  for (const float block : adaptive.blocks) EXPECT_LE(block, target);

  renderer.begin({{}, 1.0, view.world_from_camera});
  renderer.render(refined.samples);
  EXPECT_LT(rays, renderer.counters().rays * 3 / 4);
}

TEST(Adaptive, leaves_the_samples_of_a_pixel_as_they_are) {
  const View view = small_set();
  SetRenderer renderer(view);
  renderer.begin({{}, 1.0, view.world_from_camera});
  renderer.render(8);
  const render::Layers before = renderer.layers();
  std::vector<std::uint32_t> blocks(8 * 6, 0);
  blocks[8 * 3 + 4] = 1;  // x 32..39, y 24..31
  renderer.sample_only(blocks);
  renderer.render(8);
  const render::Layers after = renderer.layers();
  renderer.begin({{}, 1.0, view.world_from_camera});
  renderer.render(16);
  const render::Layers all = renderer.layers();
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool inside = x / 8 == 4 && y / 8 == 3;
      const std::size_t i = static_cast<std::size_t>(y) * 64 + x;
      EXPECT_EQ(after.composite[i], (inside ? all : before).composite[i]) << x << ", " << y;
    }
  }
}

TEST(Adaptive, ends_when_the_time_is_over) {
  const View view = small_set();
  SetRenderer renderer(view);
  renderer.begin({{}, 1.0, view.world_from_camera});
  const auto refined = pipeline::refine(renderer, quality(8, 0, 0.5), {}, {});
  EXPECT_TRUE(refined.whole);
  EXPECT_GT(refined.samples, 0);  // at least one, however slow the machine
}

TEST(Adaptive, a_block_in_need_brings_its_neighbours) {
  render::ErrorEstimate estimate;
  estimate.blocks.assign(12, 0.0f);  // 4 x 3 blocks of 8 x 8 pixels
  estimate.blocks[5] = 0.2f;
  const auto blocks = render::blocks_above(estimate, 32, 24, 0.1);
  EXPECT_EQ(blocks, (std::vector<std::uint32_t>{1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0}));
}

}  // namespace
}  // namespace previz::testing
