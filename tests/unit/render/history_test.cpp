// What is accumulated over frames: noise falls as the samples add up, a moving camera leaves values
// where they were, and nothing that has changed is still seen.
#include "daemon/core/render/passes/history.hpp"

#include "tests/support/averaged_frames.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::history_test {

constexpr int width = averaged_width, height = averaged_height;

using Stage = BoxAboveFloor;

// The rms over the picture of what a and b are off each other, over that of what b adds.
double rms_between(const Plate& a, const Plate& b) {
  double off = 0, added = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    off += std::pow(a.samples[i] - double(b.samples[i]), 2);
    added += std::pow(b.samples[i] - 20000.0, 2);
  }
  return std::sqrt(off / added);
}

// Random numbers go on from frame to frame, so N frames of one sample, each with the weight 1 / N,
// have the very samples of one frame of N. The means differ by rounding: N steps of 6e-8 each, of
// values up to four times white, and the rounding of a code: one of 65536 codes at most. Only where
// an edge is found late is a sample lost; so for nearly all pixels.
TEST(History, OfAStillCameraHasTheSamplesOfOneLongFrame) {
  const Stage stage;
  for (const int samples : {1, 2}) {
    SetRenderer frames(stage.view), whole(stage.view);
    Plate picture;
    const int count = 16 / samples;
    for (int frame = 0; frame < count; ++frame) picture = shown_frame(frames, samples, true);
    const Plate expected = shown_frame(whole, 16, false);
    EXPECT_LT(differing_codes(picture, expected), 0.02 * 3 * width * height)
        << samples << " samples per frame";
  }
}

// So it is in a picture of 3840x2160, of which no dispatch of 65,535 work groups covers more than
// half.
TEST(History, OfA4KPictureHasTheSamplesOfOneLongFrame) {
  Stage stage;
  constexpr int wide = 3840, high = 2160;
  stage.view.calibration = pinhole(wide, high, 0.9);
  stage.view.calibration.response.kind = ResponseCurve::Kind::linear;
  SetRenderer renderer(stage.view, up_to_depth(1));
  const auto plate = std::make_shared<const Plate>(
      Plate{wide, high, 16, std::vector<std::uint16_t>(std::size_t{3} * wide * high, 20000)});
  const auto picture_of = [&](int samples, bool accumulates) {
    renderer.begin({.plate = plate,
                    .exposure = 0.5,
                    .world_from_camera = stage.view.world_from_camera,
                    .accumulates = accumulates});
    renderer.render(samples);
    expect_clean(renderer.counters());
    return renderer.show(false);
  };
  picture_of(1, true);
  const Plate picture = picture_of(1, true);
  const Plate expected = picture_of(2, false);
  constexpr int bands = 8;
  int changed = 0, others[bands] = {};
  for (std::size_t i = 0; i < picture.samples.size(); ++i) {
    changed += expected.samples[i] != 20000 ? 1 : 0;
    others[i * bands / picture.samples.size()] +=
        std::abs(picture.samples[i] - expected.samples[i]) > 1 ? 1 : 0;
  }
  EXPECT_GT(changed, wide * high);
  for (const int of_band : others) EXPECT_LT(of_band, 0.02 * 3 * wide * high / bands);
}

// Of 16 times as many samples noise is at most a quarter: less, because the samples of a sequence
// are spread evenly. The reference's own noise, of 1024 samples, is an eighth of that.
TEST(History, TakesNoiseAwayAsItsSamplesAddUp) {
  const Stage stage;
  SetRenderer renderer(stage.view), reference(stage.view);
  const Plate truth = shown_frame(reference, 1024, false);
  const Plate first = shown_frame(renderer, 1, true);
  Plate last;
  for (int frame = 1; frame < 16; ++frame) last = shown_frame(renderer, 1, true);
  EXPECT_LT(rms_between(last, truth), rms_between(first, truth) / 4);
}

// Returns the last of twelve denoised frames of a camera that moves, and its pose.
Plate shown_moving(SetRenderer& renderer, glm::dmat4& pose) {
  Plate last;
  for (int frame = 0; frame < 12; ++frame) {
    pose = look_at({0.01 * frame, -2, 1.4 + 0.004 * frame}, {0, 0, 0});
    last = shown_frame(renderer, pose, 1, true, true);
  }
  return last;
}

// Denoised, too: a moving camera must not add error, and the picture must be better than that of a
// frame alone.
TEST(History, OfAMovingCameraIsBetterThanAFrameAlone) {
  const Stage stage;
  SetRenderer moving(stage.view), alone(stage.view), reference(stage.view);
  glm::dmat4 pose(1.0);
  const Plate last = shown_moving(moving, pose);
  const Plate truth = shown_frame(reference, pose, 1024, false);
  EXPECT_LT(rms_between(last, truth),
            0.7 * rms_between(shown_frame(alone, pose, 1, false, true), truth));
}

// How much of a pixel an object covers is found by 16 rays in each frame: while the camera moves,
// an outline of one sample a frame is as smooth as that of 16 samples, of which it may keep a tenth
// more error. The light on both sides has the noise of a dozen frames, which is about as much.
TEST(History, OfAMovingCameraHasOutlinesAsOfManySamples) {
  const Stage stage;
  SetRenderer moving(stage.view), alone(stage.view), reference(stage.view);
  glm::dmat4 pose(1.0);
  const Plate last = shown_moving(moving, pose);
  const Truth truth = truth_of(reference, pose, 1024);
  const double off_of_many =
      off_where(is_outline, shown_frame(alone, pose, 16, false, true), truth);
  ASSERT_GT(off_of_many, 0);
  EXPECT_LT(off_where(is_outline, last, truth), 1.1 * off_of_many);
}

// Samples of both sides together do not know the albedo of either, over which light is filtered: it
// is that of the pixels around. The first frame of four samples then has outlines as good as those
// of a frame alone, of which it may have a tenth more error.
TEST(History, KnowsTheAlbedoOfAnOutlineFromAroundIt) {
  Stage stage;
  scene::Material dark = diffuse(glm::vec3(1));
  dark.base_color_texture = add_texture(stage.view.scene, texture_of({0.2f, 0.2f, 0.2f, 1}));
  stage.view.scene.instances[stage.box].material = add_material(stage.view.scene, dark);
  SetRenderer first(stage.view), alone(stage.view), reference(stage.view);
  const glm::dmat4 pose = stage.view.world_from_camera;
  const Truth truth = truth_of(reference, pose, 1024);
  const double off_alone = off_where(is_outline, shown_frame(alone, pose, 4, false, true), truth);
  ASSERT_GT(off_alone, 0);
  EXPECT_LT(off_where(is_outline, shown_frame(first, pose, 4, true, true), truth), 1.1 * off_alone);
}

// A rod thinner than a pixel is at the middle of hardly any, so no ray looks for its outline: how
// much it covers is the mean of what the samples say. Standing still it is then as good as that of
// as many samples in one frame, of which it may have a tenth more error: what is kept of the rod's
// light is kept as halves, and what covers a pixel as a mean of all or nothing.
TEST(History, KeepsHowMuchAThinRodCovers) {
  Stage stage;
  scene::Scene& scene = stage.view.scene;
  const double pixel = 2.4 / (0.9 * width);
  scene.instances[stage.box].mesh = add_mesh(scene, box_mesh({0.25 * pixel, 0.25 * pixel, 0.6}));
  SetRenderer frames(stage.view), whole(stage.view), reference(stage.view);
  const glm::dmat4 pose = stage.view.world_from_camera;
  Plate picture;
  for (int frame = 0; frame < 16; ++frame) picture = shown_frame(frames, pose, 1, true, true);
  const Truth truth = truth_of(reference, pose, 1024);
  const double off_of_many =
      off_where(is_outline, shown_frame(whole, pose, 16, false, true), truth);
  ASSERT_GT(off_of_many, 0);
  EXPECT_LT(off_where(is_outline, picture, truth), 1.1 * off_of_many);
}

// What photons bring has a filter of its own, in the first frame of a history as in a frame alone,
// and is carried along without being blurred. Outside the ball, after a dozen frames of a moving
// camera, what is off is less than what a frame alone is off, and before the filter less than half
// of it, as if four samples were left of the twelve.
TEST(History, KeepsPhotonsLightApart) {
  Stage stage;
  stage.make_glass(60);
  SetRenderer moving(stage.view), first(stage.view), alone(stage.view), reference(stage.view);
  glm::dmat4 pose(1.0);
  const Plate last = shown_moving(moving, pose);
  const Truth truth = truth_of(reference, pose, 256);
  const auto off = [&](const Plate& picture) { return off_where(is_uncovered, picture, truth); };
  const double off_alone = off(shown_frame(alone, pose, 1, false, true));
  EXPECT_LT(off(shown_frame(first, pose, 1, true, true)), 1.1 * off_alone);
  EXPECT_LT(off(last), off_alone);
  EXPECT_LT(off(moving.show(false)), off(alone.show(false)) / 2);
}

// Photons' light is kept as halves, which hold no more than 65,504 times white. A virtual lamp that
// brings a million times as much is white in every frame: nothing becomes what is no number.
TEST(History, OfLightBeyondAllWhiteStaysWhite) {
  Stage stage;
  stage.make_glass(6e13);
  stage.view.scene.lights[0].gain_real = 0;
  SetRenderer renderer(stage.view);
  for (int frame = 0; frame < 4; ++frame) {
    const Plate picture = shown_frame(renderer, 1, true, true);
    const auto at = [&](int x, int y) {
      return picture.samples[static_cast<std::size_t>(3 * (y * width + x))];
    };
    for (int y = height - 12; y < height; ++y)
      for (int x = 0; x < width; ++x) EXPECT_EQ(at(x, y), 65535) << frame << ": " << x << ", " << y;
  }
}

// A lamp that only the mixed world has lights the floor without noise, as no light is reflected
// further. A sample lies somewhere in its pixel, and what is carried along is interpolated between
// pixels, so what is shown lies between the extremes of the 3x3 pixels around, within the two codes
// of rounding. Box and shadow are left out by looking past them, and so are the 8 pixels at the
// picture's border, into which the past is interpolated from one side only.
void expect_values_stay_in_their_places(const PinholeIntrinsics& lens) {
  Stage stage(glm::vec3(0));
  stage.view.calibration.intrinsics = lens;
  set::Light added = point_lamp({0, 0, 3}, glm::dvec3(3));
  added.gain_real = 0;
  stage.view.scene.lights = {added};
  stage.view.scene.instances[stage.box].world_from_object = at({0, 8, 0.3});
  SetRenderer moving(stage.view, up_to_depth(1)), alone(stage.view, up_to_depth(1));
  glm::dmat4 pose(1.0);
  Plate last;
  for (int frame = 0; frame < 20; ++frame) {
    pose = look_at({0.013 * frame, -2, 1.4}, {0.02 * frame, -0.5, 0});
    last = shown_frame(moving, pose, 1, true);
  }
  const Plate expected = shown_frame(alone, pose, 64, false);
  constexpr int border = 8;
  for (int y = border; y + border < height; ++y)
    for (int x = border; x + border < width; ++x) {
      const auto green = [&](const Plate& picture, int off_x, int off_y) {
        return picture.samples[static_cast<std::size_t>(3 * ((y + off_y) * width + x + off_x) + 1)];
      };
      int low = 65535, high = 0;
      for (int off_y = -1; off_y <= 1; ++off_y)
        for (int off_x = -1; off_x <= 1; ++off_x) {
          low = std::min<int>(low, green(expected, off_x, off_y));
          high = std::max<int>(high, green(expected, off_x, off_y));
        }
      ASSERT_GE(green(last, 0, 0), low - 2) << x << ", " << y;
      ASSERT_LE(green(last, 0, 0), high + 2) << x << ", " << y;
    }
}

TEST(History, OfAMovingCameraKeepsValuesInTheirPlaces) {
  expect_values_stay_in_their_places(pinhole(width, height, 0.9).intrinsics);
}

TEST(History, OfAMovingCameraKeepsValuesInTheirPlacesThroughARationalLens) {
  PinholeIntrinsics lens = pinhole(width, height, 0.9).intrinsics;
  lens.k1 = 0.05, lens.k4 = 0.25, lens.k5 = -0.05, lens.k6 = 0.02;
  expect_values_stay_in_their_places(lens);
}

TEST(History, LeavesThePlateBitForBitWhereNothingDiffers) {
  View view = random_scene(3, {.width = 71, .height = 49, .virtual_objects = 0});
  for (const bool denoise : {false, true}) {
    SetRenderer renderer(view);
    for (int frame = 0; frame < 4; ++frame) {
      const Plate plate = random_plate(71, 49, 8);
      view.world_from_camera[3].x += 0.003;
      renderer.begin({.plate = std::make_shared<const Plate>(plate),
                      .exposure = 0.85,
                      .world_from_camera = view.world_from_camera,
                      .accumulates = true});
      renderer.render(1);
      EXPECT_EQ(renderer.show(denoise).samples, plate.samples) << frame;
    }
    expect_clean(renderer.counters());
  }
}

// A frame alone, before, between and after frames that accumulate, is what it is without them.
TEST(History, IsNotSeenInAFrameThatStandsAlone) {
  const Stage stage;
  SetRenderer with(stage.view), without(stage.view);
  const Plate alone = shown_frame(without, 2, false, true);
  EXPECT_EQ(shown_frame(with, 2, false, true).samples, alone.samples);
  shown_frame(with, 2, true, true);
  shown_frame(with, 2, true, true);
  EXPECT_EQ(shown_frame(with, 2, false, true).samples, alone.samples);
}

// A snapshot's frame is that of an offline render, with the same random numbers, and the frames
// after it are averaged with those before it.
TEST(History, IsNotEndedByAFrameThatStandsAside) {
  const Stage stage;
  SetRenderer with(stage.view), without(stage.view);
  const glm::dmat4 pose = stage.view.world_from_camera;
  const Plate alone = shown_frame(without, pose, 1, false, true);
  Plate expected, last;
  for (int frame = 0; frame < 4; ++frame) expected = shown_frame(without, pose, 1, true);
  for (int frame = 0; frame < 4; ++frame) {
    last = shown_frame(with, pose, 1, true);
    with.begin(
        {.plate = gray_plate(), .exposure = 0.5, .world_from_camera = pose, .stands_aside = true});
    with.render(1);
    EXPECT_EQ(with.show(true).samples, alone.samples);
  }
  EXPECT_EQ(last.samples, expected.samples);
}

// The layers are the frame's own, and asking for them changes no picture. Showing a frame again
// adds nothing to it.
TEST(History, GivesTheSamePictureWithLayersAndWhenAskedAgain) {
  const Stage stage;
  SetRenderer renderer(stage.view);
  for (int frame = 0; frame < 3; ++frame) {
    const Plate picture = shown_frame(renderer, 1, true, true);
    render::Layers layers = renderer.layers();
    EXPECT_EQ(renderer.show(true, &layers).samples, picture.samples);
    EXPECT_EQ(renderer.show(true).samples, picture.samples);
    EXPECT_TRUE(layers.denoised);
  }
}

// A lamp, a shadow, and a jump of what throws it or of the lamp's brightness. Light comes straight
// and is not reflected further, so a frame has no noise but at outlines. Where neither the old nor
// the new outline is within a pixel, the first picture after the change is that of a renderer that
// has never seen anything else; within rounding, which is 2 codes of what the last test has said.
class HistoryAfter : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(AChange, HistoryAfter, ::testing::Values(0, 1, 2));

TEST_P(HistoryAfter, AJumpOrASwitchShowsNoGhost) {
  Stage stage(glm::vec3(0.2f));
  set::Light key = point_lamp({1, 0, 3}, glm::dvec3(3));
  stage.view.scene.lights = {key};
  SetRenderer renderer(stage.view, up_to_depth(1));
  const glm::dmat4 pose = stage.view.world_from_camera;
  for (int frame = 0; frame < 8; ++frame) shown_frame(renderer, pose, 4, true);
  std::vector<scene::Instance> instances = stage.view.scene.instances;
  if (GetParam() == 0) instances[stage.box].world_from_object = at({-0.5, 0.3, 0.3});
  if (GetParam() == 1) key.gain_mixed = 0.2;
  renderer.move(instances, {key});
  if (GetParam() == 2)
    renderer.set_environment(uniform_environment(glm::vec3(0.02f)), set::LightSampling::importance);
  const Plate first = shown_frame(renderer, pose, 4, true);
  if (GetParam() == 2) stage.view.environment = uniform_environment(glm::vec3(0.02f));
  SetRenderer fresh(stage.view, up_to_depth(1));
  fresh.move(instances, {key});
  const Plate expected = shown_frame(fresh, pose, 256, false);
  const Plate noisy = shown_frame(fresh, pose, 4, false);
  // A ghost would be seen beside the noise of a frame.
  EXPECT_LT(rms_between(first, expected), 1.3 * rms_between(noisy, expected));
}

TEST(History, OfTheLightIsComparedByWhatArrives) {
  const std::vector<glm::dvec3> dark(256, glm::dvec3(0)), even(256, glm::dvec3(0.5));
  std::vector<glm::dvec3> window = even;
  window[3] = glm::dvec3(0.5 * 128);
  EXPECT_EQ(render::change_of_light(even, even), 0);
  EXPECT_EQ(render::change_of_light(dark, dark), 0);
  EXPECT_EQ(render::change_of_light(dark, even), 1);
  EXPECT_NEAR(render::change_of_light(even, window), 127.0 / 383, 1e-12);
  set::Light key = lamp(set::LightType::point, glm::dvec3(3));
  const std::vector<set::Light> one{key};
  key.emission *= 0.75;
  EXPECT_NEAR(render::change_of_lamps(one, {key}), 0.25, 1e-12);
  EXPECT_EQ(render::change_of_lamps(one, one), 0);
  EXPECT_EQ(render::change_of_lamps(one, {}), 1);
  key.position.x += 0.05;
  EXPECT_GT(render::change_of_lamps(one, {key}), 1);
}

}  // namespace previz::test::history_test
