// Dithering: a difference of the worlds that is less than a code has the right mean, the pattern is
// of high frequencies, and the plate stays what it is.
#include "daemon/core/render/picture/blue_noise.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::dither_test {

TEST(BlueNoise, HasEveryThresholdOnceAndIsTheSameEachTime) {
  constexpr int side = 16;
  std::vector<float> thresholds = render::blue_noise(side);
  EXPECT_EQ(render::blue_noise(side), thresholds);
  std::ranges::sort(thresholds);
  ASSERT_EQ(thresholds.size(), std::size_t{side * side});
  for (std::size_t i = 0; i < thresholds.size(); ++i)
    EXPECT_EQ(thresholds[i], (static_cast<float>(i) + 0.5f) / (side * side));
}

// Independent thresholds have a variance of 1/12, spread evenly over all frequencies. Blue noise
// has next to none of it in waves longer than six pixels: here, less than a tenth.
TEST(BlueNoise, HasNoLongWaves) {
  constexpr int side = gpu::DITHER_SIDE;
  const std::vector<float> thresholds = render::blue_noise(side);
  double power = 0;
  int waves = 0;
  for (int v = 0; v <= side / 6; ++v)
    for (int u = 0; u <= side / 6; ++u) {
      if (u + v == 0 || u * u + v * v > side * side / 36) continue;
      double real = 0, imaginary = 0;
      for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
          const double turn = 2 * std::numbers::pi * (u * x + v * y) / side;
          const double value = thresholds[static_cast<std::size_t>(y * side + x)];
          real += value * std::cos(turn);
          imaginary += value * std::sin(turn);
        }
      power += (real * real + imaginary * imaginary) / (side * side);
      ++waves;
    }
  EXPECT_LT(power / waves, 0.1 / 12);
}

// A floor under an even sky, and a virtual box whose shadow fades out over it.
View shadowed_floor() {
  View view = empty_view({0, -2, 1.4}, {0, 0, 0}, pinhole(96, 80, 0.9), glm::vec3(0.4f));
  scene::Scene& scene = view.scene;
  const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
  add(scene, rectangle_mesh(glm::dvec2(20)), gray);
  add(scene, box_mesh(glm::dvec3(0.5)), gray, at({3.2, -0.5, 0.5}), scene::world_mixed);
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  return view;
}

Plate even_plate(int bits) {
  return {96, 80, bits, std::vector<std::uint16_t>(3 * 96 * 80, bits == 8 ? 128 : 128 * 257)};
}

Plate shown(const View& view, int bits, bool dithers) {
  SetRenderer renderer(view);
  renderer.begin({.plate = std::make_shared<const Plate>(even_plate(bits)),
                  .exposure = 0.5,
                  .world_from_camera = view.world_from_camera,
                  .dithers = dithers});
  renderer.render(16);
  Plate picture = renderer.show(true);
  EXPECT_EQ(renderer.show(true).samples, picture.samples) << "a still picture stands still";
  expect_clean(renderer.counters());
  return picture;
}

double mean_of(const Plate& picture) {
  double sum = 0;
  for (const std::uint16_t sample : picture.samples) sum += sample;
  return sum / static_cast<double>(picture.samples.size());
}

// The far shadow darkens the floor by less than half a code of eight bits nearly everywhere, as 16
// bits show, so that rounding loses it. Each code is off by its own rounding, of at most a code,
// which over n of them leaves a standard error of 1 / sqrt(4 n) at most.
TEST(Dithering, KeepsAMeanThatIsLessThanACode) {
  const View view = shadowed_floor();
  const double darkened = mean_of(shown(view, 16, false)) / 257 - 128;
  ASSERT_LT(darkened, -0.02);
  ASSERT_GT(darkened, -0.4);
  const double error = 1 / std::sqrt(4.0 * 3 * 96 * 80);
  EXPECT_NEAR(mean_of(shown(view, 8, true)) - 128, darkened, 4 * error);
  EXPECT_GT(std::abs(mean_of(shown(view, 8, false)) - 128 - darkened), 4 * error);
}

TEST(Dithering, LeavesThePlateBitForBitWhereTheWorldsAreTheSame) {
  View view = shadowed_floor();
  view.scene.instances.pop_back();
  for (const int bits : {8, 16})
    EXPECT_EQ(shown(view, bits, true).samples, even_plate(bits).samples);
}

}  // namespace previz::test::dither_test
