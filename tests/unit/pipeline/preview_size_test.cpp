// A preview's smaller picture is the same view through larger pixels, averaged in linear light.
#include "daemon/core/pipeline/preview_size.hpp"

#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/load.hpp"
#include "drivers/plate.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::preview_size_test {

const ResponseCurve srgb{};
const ResponseCurve linear{ResponseCurve::Kind::linear, 1, {}};

PinholeIntrinsics scaled_lens(const PinholeIntrinsics& lens, double scale) {
  ObserverCalibration calibration;
  calibration.intrinsics = lens;
  return scaled(calibration, scale).intrinsics;
}

Plate plate(int width, int height, int bits, std::uint16_t sample) {
  return {width, height, bits, std::vector<std::uint16_t>(std::size_t{3} * width * height, sample)};
}

TEST(PreviewSize, ThePicturesEdgesStayWhereTheyAre) {
  const PinholeIntrinsics full{641, 480, 600, 610, 322.25, 238.5, 0.1, -0.02, 0.001, 0.002, 0.003};
  const PinholeIntrinsics half = scaled_lens(full, 0.5);
  EXPECT_EQ(half.width, 321);  // 320.5 to nearest, away from zero
  EXPECT_EQ(half.height, 240);
  // The rays through the left and right edge, (-0.5 - cx)/fx and (width - 0.5 - cx)/fx, and alike
  // in y: the same in both; as the lens model bends these coordinates, its terms stay.
  EXPECT_NEAR((-0.5 - half.cx) / half.fx, (-0.5 - full.cx) / full.fx, 1e-14);
  EXPECT_NEAR((320.5 - half.cx) / half.fx, (640.5 - full.cx) / full.fx, 1e-14);
  EXPECT_NEAR((-0.5 - half.cy) / half.fy, (-0.5 - full.cy) / full.fy, 1e-14);
  EXPECT_NEAR((239.5 - half.cy) / half.fy, (479.5 - full.cy) / full.fy, 1e-14);
  EXPECT_EQ(half.k1, full.k1);
  EXPECT_EQ(half.p2, full.p2);
  EXPECT_EQ(half.k3, full.k3);
}

TEST(PreviewSize, ASideIsNeverEmptyAndScaleOneChangesNothing) {
  const PinholeIntrinsics full{40, 30, 50, 50, 19.3, 14.1, 0, 0, 0, 0, 0};
  EXPECT_EQ(scaled_lens(full, 0.01).width, 1);
  EXPECT_EQ(scaled_lens(full, 0.01).height, 1);
  EXPECT_EQ(scaled_lens(full, 1).width, 40);
  EXPECT_EQ(scaled_lens(full, 1).fx, 50);
  EXPECT_EQ(scaled_lens(full, 1).cx, 19.3);
}

// Also where a large pixel covers parts of small ones: 7 into 3.
TEST(PreviewSize, AnEvenPlateKeepsItsSamples) {
  for (const int bits : {8, 16}) {
    const lighting::Response response(srgb, bits);
    const int max = (1 << bits) - 1;
    for (int i = 0; i <= 255; ++i) {
      const auto sample = static_cast<std::uint16_t>(max / 255 * i);
      EXPECT_EQ(scaled(plate(7, 5, bits, sample), 0.43, response).samples,
                plate(3, 2, bits, sample).samples);
    }
  }
}

// Half black, half white: a linear signal of 0.5, which sRGB writes as 255 * 0.7354 = 187.5.
TEST(PreviewSize, MeansAreOfLinearLight) {
  Plate checker = plate(4, 4, 8, 0);
  for (std::size_t pixel = 0; pixel < 16; ++pixel)
    if ((pixel / 4 + pixel) % 2 == 0)
      for (std::size_t channel = 0; channel < 3; ++channel)
        checker.samples[3 * pixel + channel] = 255;
  const Plate half = scaled(checker, 0.5, lighting::Response(srgb, 8));
  EXPECT_EQ(half.samples, plate(2, 2, 8, 188).samples);
}

// Rows and channels stay apart: every sample its own value, linear, so that the mean of a block of
// 2x2 pixels is the mean of its samples.
TEST(PreviewSize, EveryPixelIsTheMeanOfItsOwnArea) {
  Plate ramp = plate(8, 6, 16, 0);
  std::iota(ramp.samples.begin(), ramp.samples.end(), std::uint16_t{1000});
  const Plate half = scaled(ramp, 0.5, lighting::Response(linear, 16));
  ASSERT_EQ(half.width, 4);
  ASSERT_EQ(half.height, 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x)
      for (int c = 0; c < 3; ++c) {
        // Rows are 24 samples apart, columns 3: the block's mean is 13.5 above its first sample.
        const int first = 1000 + 2 * y * 24 + 2 * x * 3 + c;
        EXPECT_NEAR(half.samples[static_cast<std::size_t>((y * 4 + x) * 3 + c)], first + 13.5,
                    0.51);
      }
}

constexpr int samples = 64;

// Light from one side: what is seen of it is noisy.
Light light_from_aside() {
  Light light;
  light.lighting.environment = {4, std::vector<glm::vec3>(16, glm::vec3(0.2F))};
  light.lighting.environment.radiance[5] = glm::vec3(3);
  light.encoded = render::encode_environment(light.lighting.environment);
  return light;
}

// The small take's card, rendered at this size.
Shot card(double scale, bool denoise) {
  const test::TemporaryDirectory directory;
  test::write_small_take(directory.path());
  Take take = open_take(directory / "session", {});
  take.set.quality.samples = samples;
  take.set.quality.denoise = denoise;
  RenderStageOptions options;
  options.layers = true;
  options.scale = scale;
  RenderStage stage(render::open_device(), take.set, take.observer, scene::load_scene(take.set),
                    options);
  Shot shot;
  shot.frame = std::make_shared<Frame>(test::small_take_frame(1));
  shot.light = std::make_shared<const Light>(light_from_aside());
  shot.track.pose.emplace();  // a metre above the floor, looking straight down
  shot.track.pose->world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 1, 1}};
  stage(shot);
  EXPECT_EQ(shot.untouched, "");
  EXPECT_EQ(shot.picture->width, shot.layers->width);
  shot.error = stage.error();
  return shot;
}

// A camera that was exchanged may have another size; in a take, all frames have one.
TEST(RenderStageSize, AFrameOfAnotherSizePassesThroughWhereThatIsWantedAndIsAnErrorElsewhere) {
  const test::TemporaryDirectory directory;
  test::write_small_take(directory.path());
  const Take take = open_take(directory / "session", directory / "set.toml");
  for (const double scale : {1.0, 0.5})
    for (const bool passes : {true, false}) {
      RenderStageOptions options;
      options.scale = scale;
      options.passes_other_sizes = passes;
      RenderStage stage(render::open_device(), take.set, take.observer, scene::load_scene(take.set),
                        options);
      Frame frame = test::small_take_frame(1);
      frame.width = 64;
      frame.height = 48;
      frame.bytes.resize(frame_bytes(frame.format, frame.width, frame.height));
      Shot shot;
      shot.frame = std::make_shared<Frame>(std::move(frame));
      shot.light = std::make_shared<const Light>(light_from_aside());
      shot.track.pose.emplace();
      if (!passes) {
        EXPECT_THROW(stage(shot), Error) << scale;
        continue;
      }
      stage(shot);
      EXPECT_EQ(shot.untouched, "observer: a frame of 64x48 does not fit the calibration's 48x36");
      EXPECT_TRUE(shot.whole);
      EXPECT_EQ(shot.picture->samples, to_plate(*shot.frame).samples) << scale;
      shot.frame = std::make_shared<Frame>(test::small_take_frame(1));  // the old one is back
      shot.plate.reset();
      shot.untouched.clear();
      stage(shot);
      EXPECT_EQ(shot.untouched, "");
    }
}

// Also with layers, as a snapshot has them, and where the plate passes through.
TEST(RenderStageSize, ALivePictureHasTheCamerasSize) {
  const test::TemporaryDirectory directory;
  test::write_small_take(directory.path());
  Take take = open_take(directory / "session", directory / "set.toml");
  take.set.quality.samples = 4;
  for (const bool layers : {false, true}) {
    RenderStageOptions options;
    options.scale = 0.5;
    options.is_live = true;
    options.layers = layers;
    RenderStage stage(render::open_device(), take.set, take.observer, scene::load_scene(take.set),
                      options);
    for (const bool has_pose : {true, false}) {
      SCOPED_TRACE(std::to_string(layers) + std::to_string(has_pose));
      Shot shot;
      shot.frame = std::make_shared<Frame>(test::small_take_frame(1));
      shot.light = std::make_shared<const Light>(light_from_aside());
      if (has_pose) {
        shot.track.pose.emplace();
        shot.track.pose->world_from_camera = {
            {1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 1, 1}};
      }
      stage(shot);
      EXPECT_EQ(shot.untouched.empty(), has_pose);
      const Plate plate = to_plate(*shot.frame);
      ASSERT_EQ(shot.picture->width, 48);
      ASSERT_EQ(shot.picture->height, 36);
      const auto same = std::ranges::mismatch(shot.picture->samples, plate.samples).in1;
      EXPECT_EQ(same == shot.picture->samples.end(), !has_pose) << "there is a card";
      EXPECT_EQ(shot.layers ? shot.layers->width : 0, !layers ? 0 : has_pose ? 24 : 48);
    }
  }
}

render::Layers render_card(double scale) {
  return *card(scale, true).layers;
}

// What is taken away is no error that is known to be gone.
TEST(RenderStageError, IsThatOfTheSamplesWhetherDenoisedOrNot) {
  const Shot noisy = card(1, false);
  const Shot clean = card(1, true);
  EXPECT_GT(noisy.error, 0);
  EXPECT_EQ(clean.error, noisy.error);
  EXPECT_NE(clean.layers->variance, noisy.layers->variance);
  EXPECT_FALSE(noisy.layers->denoised);
  EXPECT_TRUE(clean.layers->denoised);
}

// In units of the picture's width and height.
struct Cover {
  double area = 0;
  glm::dvec2 centre{0};
};

Cover cover_of(const render::Layers& layers) {
  Cover cover;
  for (int y = 0; y < layers.height; ++y)
    for (int x = 0; x < layers.width; ++x) {
      const double mask = layers.mask[static_cast<std::size_t>(y * layers.width + x)];
      cover.area += mask;
      cover.centre += mask * glm::dvec2((x + 0.5) / layers.width, (y + 0.5) / layers.height);
    }
  cover.centre /= cover.area;
  cover.area /= layers.width * layers.height;
  return cover;
}

// The card, 13.3 pixels a side, covers as much of the preview and at the same place. Its noise is
// of the pixels at its edge, variance at most 1/4 a sample: in the preview 27 pixels, so the
// covered area has a standard error of at most sqrt(27 / 4 / 64) = 0.32 pixels of 432 (0.11 in the
// full picture: together 0.34), and its centre one of at most 0.34 * 3.3 / 44 = 0.026 pixels of 18.
// Four of them are allowed; a centre that is off by half a pixel of the plate is off by 0.25.
TEST(PreviewSize, AVirtualObjectStandsWhereItStandsInThePlate) {
  const render::Layers half = render_card(0.5);
  ASSERT_EQ(half.width, 24);
  ASSERT_EQ(half.height, 18);
  const Cover in_half = cover_of(half), in_full = cover_of(render_card(1));
  EXPECT_NEAR(in_half.area, in_full.area, 4 * 0.34 / 432);
  EXPECT_NEAR(in_half.centre.x, in_full.centre.x, 4 * 0.026 / 24);
  EXPECT_NEAR(in_half.centre.y, in_full.centre.y, 4 * 0.026 / 18);
}

}  // namespace previz::pipeline::preview_size_test
