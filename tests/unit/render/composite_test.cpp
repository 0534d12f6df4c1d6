// The composite: untouched plates bit for bit, samples independent of how they are asked for, and
// the equation itself.
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::composite_test {

Plate show(const View& view, const Plate& plate, int samples) {
  SetRenderer renderer(view);
  renderer.begin({std::make_shared<const Plate>(plate), 0.85, view.world_from_camera});
  renderer.render(samples);
  expect_clean(renderer.counters());
  return renderer.show(false);
}

View real_set() {
  return random_scene(3, {.width = 70, .height = 50, .virtual_objects = 0});
}

// A device that fails may bring a plate whose codes no camera has. They count as white; nothing is
// read past the response.
TEST(Composite, OfCodesThatNoCameraHasTakesTheLast) {
  const lighting::Response response({}, 8);
  Plate plate = random_plate(1, 1, 8);
  plate.samples = {255, 256, 65535};
  const render::PlateRadiance radiance = render::plate_radiance(plate, response, 1);
  for (const int channel : {1, 2}) {
    EXPECT_EQ(radiance.channel(0, channel).radiance, radiance.channel(0, 0).radiance);
    EXPECT_EQ(radiance.channel(0, channel).clipped, radiance.channel(0, 0).clipped);
  }
}

TEST(Composite, WithoutAVirtualObjectThePlateComesBackBitForBit) {
  View view = real_set();
  for (const int bits : {8, 16}) {
    const Plate plate = random_plate(70, 50, bits);
    EXPECT_EQ(show(view, plate, 2).samples, plate.samples) << bits << " bits, pinhole";
  }
  PinholeIntrinsics& lens = view.calibration.intrinsics;
  lens.k1 = -0.118;
  lens.k2 = 0.041;
  lens.p1 = 0.0009;
  lens.p2 = -0.0007;
  lens.k3 = -0.006;
  const Plate plate = random_plate(70, 50, 8);
  EXPECT_EQ(show(view, plate, 2).samples, plate.samples) << "distorted";
  lens.k4 = 0.09, lens.k5 = -0.03, lens.k6 = 0.02;
  EXPECT_EQ(show(view, plate, 2).samples, plate.samples) << "by the rational model";
  view.calibration.lens = ThinLens{0.05, 1.4, 0.8};
  EXPECT_EQ(show(view, plate, 2).samples, plate.samples) << "defocused";
}

TEST(Composite, SamplesDoNotDependOnHowTheyAreAskedFor) {
  const View view = random_scene(2, {.width = 45, .height = 31});
  SetRenderer renderer(view);
  const render::Layers whole = renderer.rendered(7);
  renderer.begin({{}, 1.0, view.world_from_camera});
  for (const int part : {1, 4, 2}) renderer.render(part);
  const render::Layers parts = renderer.layers();
  EXPECT_EQ(parts.samples, 7);
  EXPECT_EQ(whole.mixed, parts.mixed);
  EXPECT_EQ(whole.diff, parts.diff);
  EXPECT_EQ(whole.variance, parts.variance);
}

// A plate of one code.
render::PlateRadiance seen_as(double radiance, double error = 0) {
  static const std::vector<std::uint16_t> codes(3 * 1000);
  return {{{radiance, error, 0}}, codes};
}

// A virtual object of radiance 0.5 covers the white half of a black-and-white pixel: the composite
// is 0.25, where composites of single samples would average to 0.5 (shaders/README.md, "The
// composite").
TEST(Composite, CoveredPixelsUseMeansNotSamples) {
  gpu::GpuPixel pixel{};
  // Two samples: one covered (Lm = 0.5, Lr = 1), one not (Lm = Lr = 0).
  pixel.mixed_high = gpu::vec4(0.5f, 0.5f, 0.5f, 1.0f);
  pixel.diff_high = gpu::vec4(-0.5f, -0.5f, -0.5f, 0.0f);
  pixel.square_high.w = 2;
  const render::PlateRadiance plate = seen_as(0.5);
  const render::Layers layers = layers_of(std::span(&pixel, 1), 2, plate);
  // 0.25 + (1 - 0.5) (0.5 - 0.5)
  EXPECT_FLOAT_EQ(layers.composite[0].g, 0.25f);
  EXPECT_FLOAT_EQ(layers.real[0].g, 0.5f);
  EXPECT_FLOAT_EQ(layers.mask[0], 0.5f);
}

// One uncovered pixel of one sample, as `rule` composites it.
double composited(double camera, double mixed, double real, const render::CompositeRule& rule) {
  gpu::GpuPixel pixel{};
  pixel.mixed_high = gpu::vec4(static_cast<float>(mixed));
  pixel.mixed_high.w = 0;
  pixel.diff_high = pixel.uncovered_high = gpu::vec4(static_cast<float>(mixed - real));
  pixel.uncovered_high.w = gpu::SAMPLE_FULL;
  return layers_of(std::span(&pixel, 1), 1, seen_as(camera, 1e-6), rule).composite[0].g;
}

// A shadow halves the light on a surface whose albedo the phantom has wrong by a factor of two.
TEST(Composite, TheRatioForgivesAWrongAlbedoAndTheSumDoesNot) {
  using enum set::Composite;
  const double camera = 0.4, real = 0.8, mixed = 0.4;
  EXPECT_NEAR(composited(camera, mixed, real, {additive, 0}), 0.0, 1e-7);
  EXPECT_FLOAT_EQ(composited(camera, mixed, real, {ratio, 0}), 0.2);
  // Wrong by floor^2 / Lr^2 of the sum's error.
  EXPECT_NEAR(composited(camera, mixed, real, {hybrid, 0.01}), 0.2, 0.2 * 2e-4);
}

// A virtual lamp on a real surface that was black.
TEST(Composite, TheSumLightsABlackSurfaceAndTheRatioDoesNot) {
  using enum set::Composite;
  EXPECT_FLOAT_EQ(composited(0, 0.3, 0, {additive, 0}), 0.3);
  EXPECT_FLOAT_EQ(composited(0, 0.3, 0, {ratio, 0}), 0.0);
  EXPECT_FLOAT_EQ(composited(0, 0.3, 0, {hybrid, 0.01}), 0.3);
}

// The model is three times as bright as the picture, and a shadow halves its light: more than there
// is.
TEST(Composite, IsNeverBelowZeroAndSaysWhereItWouldBe) {
  EXPECT_EQ(composited(0.2, 0.3, 0.6, {set::Composite::additive, 0}), 0.0);
  for (const auto kind : all_composites)
    for (const double real : {0.0, 1e-3, 0.3, 5.0, 1e6})
      for (const double mixed : {0.0, 1e-4, 0.3, 10.0})
        EXPECT_GE(composited(0.2, mixed, real, {kind, 0.01}), 0.0) << real << " " << mixed;

  gpu::GpuPixel in_shadow{}, lit{};
  for (gpu::GpuPixel* pixel : {&in_shadow, &lit}) {
    pixel->mixed_high = gpu::vec4(0.3f, 0.3f, 0.3f, 0);
    const float difference = pixel == &lit ? 0.1f : -0.3f;
    pixel->diff_high = pixel->uncovered_high = gpu::vec4(glm::vec3(difference), 0);
    pixel->square_high.w = 1;
  }
  const std::vector<gpu::GpuPixel> pixels{lit, in_shadow, lit, in_shadow};
  const render::Layers layers = layers_of(pixels, 1, seen_as(0.2));
  EXPECT_EQ(render::below_zero(layers), 2u);
}

TEST(Composite, AllRulesAreOneWhereTheModelIsRight) {
  for (const auto kind : all_composites)
    EXPECT_FLOAT_EQ(composited(0.5, 0.2, 0.5, {kind, 0.01}), 0.2);
}

// A virtual object of radiance 1 covers half of a pixel whose phantom has half of the true albedo.
// The rule may forgive that on the real surface, but it must not multiply the object's own light:
// the true value is 0.5 * 1 + 0.5 * 0.2.
TEST(Composite, NoRuleMultipliesAnObjectsOwnLight) {
  gpu::GpuPixel pixel{};
  // Two samples: one covered (Lm = 1, Lr = 0.1), one not (Lm = Lr = 0.1).
  pixel.mixed_high = gpu::vec4(1.1f, 1.1f, 1.1f, 1.0f);
  pixel.diff_high = gpu::vec4(0.9f, 0.9f, 0.9f, 0.0f);
  pixel.square_high.w = 2;
  const render::PlateRadiance plate = seen_as(0.2);
  for (const auto kind : all_composites) {
    const render::Layers layers = layers_of(std::span(&pixel, 1), 2, plate, {kind, 0.01});
    EXPECT_NEAR(layers.composite[0].g, 0.6, 1e-6);
  }
}

// Half of n samples meet a virtual object of radiance 1, the others a real surface of 0.2 on which
// nothing changes. The composite is 0.2 + 0.8 mean(M), and M has a variance of 1/4.
TEST(Composite, TheVarianceAtAnEdgeHoldsTheMasks) {
  const float n = 100;
  gpu::GpuPixel pixel{};
  pixel.mixed_high = n * gpu::vec4(0.6f, 0.6f, 0.6f, 0.5f);
  pixel.diff_high = n * gpu::vec4(0.4f, 0.4f, 0.4f, 0.0f);
  pixel.square_high = n * gpu::vec4(0.5f, 0.5f, 0.5f, 1.0f);
  const render::PlateRadiance plate = seen_as(0.2);
  const render::Layers layers = layers_of(std::span(&pixel, 1), 100, plate);
  EXPECT_NEAR(layers.composite[0].g, 0.6, 1e-6);
  EXPECT_NEAR(layers.variance[0].g, 0.64 * 0.25 / (n - 1.0), 1e-8);
}

// A ramp of light from black to three times white, in a shadow that leaves a share of it: the
// picture is that which the camera would have taken of the shadow, by every rule, and it is
// continuous where the ramp runs into white.
TEST(Composite, AShadowOnAClippedPlateIsNoDarkerThanTheCameraWouldSeeIt) {
  constexpr int width = 600;
  const lighting::Response response({}, 8);
  Plate plate{width, 1, 8, {}};
  std::vector<gpu::GpuPixel> pixels(width);
  for (const double share : {0.999, 0.7, 0.5, 0.2}) {
    plate.samples.clear();
    for (int x = 0; x < width; ++x) {
      const double light = 3.0 * x / width;
      plate.samples.insert(plate.samples.end(), 3, response.forward(light));
      const auto real = static_cast<float>(light), mixed = static_cast<float>(share * light);
      pixels[x] = {};
      pixels[x].mixed_high = gpu::vec4(mixed, mixed, mixed, 0);
      pixels[x].diff_high = pixels[x].uncovered_high =
          gpu::vec4(mixed - real, mixed - real, mixed - real, gpu::SAMPLE_FULL);
      pixels[x].square_high.w = 1;
    }
    const render::PlateRadiance radiance = render::plate_radiance(plate, response, 1);
    for (const auto kind : all_composites) {
      const render::Layers layers = layers_of(pixels, 1, radiance, {kind, 0.01});
      // The plate is off by half a code at most. The sum keeps that as radiance, and in the shadow
      // a code is share^0.58 of the radiance that it is in the light (the exponent of sRGB's
      // derivative, 1 - 1 / 2.4): 0.5 / 0.2^0.58 = 1.3 codes, and half a code by its own rounding.
      for (int x = 0; x < width; ++x)
        EXPECT_NEAR(response.forward(layers.composite[x].g),
                    response.forward(share * 3.0 * x / width), 2)
            << x << ", " << share;
    }
  }
}

// The same on the device, for a table in the sun that is exposed three times too long.
TEST(Composite, AShadowOnAnOverexposedTableStaysWhiteByBothEstimators) {
  View view = random_scene(4, {.width = 64, .height = 48, .real_objects = 0});
  for (glm::vec3& radiance : view.environment.radiance) radiance *= 8.0f;
  for (const auto estimator : both_estimators) {
    SetRenderer renderer(view, {.estimator = estimator});
    Plate plate{64, 48, 8, std::vector<std::uint16_t>(3 * 64 * 48, 255)};
    renderer.begin({std::make_shared<const Plate>(plate), 1.0, view.world_from_camera});
    renderer.render(64);
    const render::Layers layers = renderer.layers();
    const Plate shown = renderer.show(false);
    std::size_t shaded = 0;
    for (std::size_t i = 0; i < layers.mask.size(); ++i) {
      if (layers.mask[i] > 0 || layers.diff[i].g >= 0) continue;
      ++shaded;
      // What the camera would take: the light that is left, or the plate where that is still white.
      const double left = std::max(layers.real[i].g, 1.0f) + layers.diff[i].g;
      EXPECT_NEAR(layers.composite[i].g, std::min(left, 1.0), 1e-4) << i;
      if (left > 1) {
        EXPECT_EQ(shown.samples[3 * i + 1], 255) << i;
      }
    }
    EXPECT_GT(shaded, 100u);
    expect_clean(renderer.counters());
  }
}

TEST(Composite, TwoFloatSumsKeepWhatOneFloatLoses) {
  gpu::GpuPixel pixel{};
  pixel.mixed_high = gpu::vec4(16777216.0f, 0, 0, 0);
  pixel.mixed_low = gpu::vec4(0.5f, 0, 0, 0);
  const render::Layers layers = layers_of(std::span(&pixel, 1), 1);
  EXPECT_FLOAT_EQ(layers.mixed[0].r, static_cast<float>(16777216.5));
  EXPECT_EQ(layers.composite[0].r, 0.0f);  // nothing covered, a black plate, no difference
}

TEST(Composite, AFrameOfAnotherSizeIsRefused) {
  const View view = real_set();
  SetRenderer renderer(view);
  EXPECT_THROW(renderer.begin({std::make_shared<const Plate>(random_plate(32, 32, 8)), 1.0,
                               view.world_from_camera}),
               std::exception);
}

// An out-of-focus point becomes a uniform disc of radius fx R |1/z - 1/focus|, whose variance along
// one axis is radius^2 / 4; the pixel's box adds 1/12 and the emitter its own width^2 / 12.
TEST(Lens, DefocusIsTheCircleOfConfusion) {
  View view = empty_view({0, 0, 0}, {0, 0, -1}, pinhole(64, 64, 0.4));  // looking down
  const double depth = 2.0, width = 0.02;
  add(view.scene, rectangle_mesh({width, width}), emitter(glm::vec3(1)), at({0, 0, -depth}));
  view.calibration.lens = ThinLens{0.05, 1.0, 1.0};
  const int samples = 512;
  const Rendered result = render_view(view, samples);
  double sum = 0, first = 0, second = 0;
  for (const auto& [x, y, i] : pixels_of(64, 64)) {
    const double value = result.layers.mixed[i].g;
    sum += value;
    first += value * x;
    second += value * x * x;
  }
  const double fx = view.calibration.intrinsics.fx;
  const double radius = fx * 0.025 * std::abs(1 / depth - 1 / 1.0);
  const double pixels = fx * width / depth;  // the emitter's width
  const double expected = radius * radius / 4 + 1.0 / 12 + pixels * pixels / 12;
  const double centre = first / sum;
  // Every sample that sees the emitter counts 1, so there are sum * samples of them; a mean of n
  // has the error sqrt(variance / n), a variance the relative error sqrt(2 / n) at most (a normal
  // distribution's; a disc's tails are shorter).
  const double contributing = sum * samples;
  EXPECT_NEAR(centre, 31.5, 4 * std::sqrt(expected / contributing));
  EXPECT_NEAR((second / sum - centre * centre) / expected, 1, 4 * std::sqrt(2 / contributing));
  // No light is lost: the same flux as in focus, the emitter's own area in pixels.
  EXPECT_NEAR(sum / (pixels * pixels), 1, 4 / std::sqrt(contributing));
  expect_clean(result.counters);
}

}  // namespace previz::test::composite_test
