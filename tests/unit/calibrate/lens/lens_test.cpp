// What depth of field needs of the lens, from what is known of it.
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/lens/lens_fit.hpp"
#include "tests/support/test.hpp"

namespace previz::calibrate::lens_test {

// A 35 mm lens focused at 1.2 m before a sensor 24 mm wide: its image stands at
// v = f d / (d - f) = 36.0515... mm.
LensFacts known_lens() {
  const double f = 0.035, d = 1.2, v = f * d / (d - f);
  LensFacts facts;
  facts.f_number = 2.8;
  facts.focus_distance_m = d;
  facts.sensor_width_m = 0.024;
  facts.intrinsics = PinholeIntrinsics{1920, 1080, v / 0.024 * 1920};
  return facts;
}

TEST(ThinLensFit, FocalLengthFollowsFromTheImageDistance) {
  const LensFound found = find_lens(known_lens());
  EXPECT_NEAR(found.lens.focal_length_m, 0.035, 1e-12);
  EXPECT_EQ(found.lens.f_number, 2.8);
  EXPECT_EQ(found.notes.size(), 3u);
}

TEST(ThinLensFit, WhatIsStatedGoesBeforeThePhotograph) {
  LensFacts facts = known_lens();
  facts.photo = PhotoData{{}, 4.0, {}, 0.0352, 3.0, ""};
  const LensFound found = find_lens(facts);
  EXPECT_EQ(found.lens.f_number, 2.8);
  EXPECT_EQ(found.lens.focus_distance_m, 1.2);
  EXPECT_EQ(found.lens.focal_length_m, 0.0352);
  EXPECT_EQ(found.notes.size(), 3u);  // 0.6 % is no contradiction
}

TEST(ThinLensFit, AZoomThatWasMovedIsSaid) {
  LensFacts facts = known_lens();
  facts.focal_length_m = 0.050;
  const LensFound found = find_lens(facts);
  EXPECT_EQ(found.lens.focal_length_m, 0.050);
  ASSERT_EQ(found.notes.size(), 4u);
  EXPECT_THAT(found.notes[3], HasSubstr("35.00 mm"));
}

TEST(ThinLensFit, WhatIsMissingIsNamed) {
  LensFacts facts = known_lens();
  facts.f_number.reset();
  EXPECT_THAT(test::error_of([&] { find_lens(facts); }), HasSubstr("f-number is unknown"));
  facts = known_lens();
  facts.sensor_width_m.reset();
  EXPECT_THROW(find_lens(facts), Error);
  facts = known_lens();
  facts.focal_length_m = 2;
  EXPECT_THROW(find_lens(facts), Error);
}

// At the ends of the sharp range the circle of confusion is the pixel that was allowed.
TEST(ThinLensFit, TheSharpRangeEndsAtTheCircleOfConfusion) {
  const LensFacts facts = known_lens();
  const ThinLens lens = find_lens(facts).lens;
  const SharpRange sharp = sharp_range(lens, facts.intrinsics->fx, 1);
  const auto circle_px = [&](double z) {
    return facts.intrinsics->fx * lens.focal_length_m / lens.f_number *
           std::abs(1 / lens.focus_distance_m - 1 / z);
  };
  EXPECT_NEAR(circle_px(sharp.near_m), 1, 1e-9);
  EXPECT_NEAR(circle_px(sharp.far_m), 1, 1e-9);
  EXPECT_TRUE(std::isinf(sharp_range(lens, facts.intrinsics->fx, 1000).far_m));
}

TEST(ThinLensFit, WritesTheTableThatASetFileTakes) {
  ObserverCalibration calibration;
  calibration.intrinsics = *known_lens().intrinsics;
  calibration.intrinsics.fy = calibration.intrinsics.fx;
  const ThinLens lens = find_lens(known_lens()).lens;
  const set::Set set =
      set::parse_set(set::intrinsics_toml(calibration) + set::lens_toml(lens), "printed.toml");
  ASSERT_TRUE(set.observer.calibration && set.observer.calibration->lens);
  EXPECT_NEAR(set.observer.calibration->lens->focal_length_m, lens.focal_length_m, 1e-13);
  EXPECT_EQ(set.observer.calibration->lens->focus_distance_m, 1.2);
}

}  // namespace previz::calibrate::lens_test
