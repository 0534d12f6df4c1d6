// Carriers: things with tags that are moved by hand, on pictures whose poses the test knows.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/tracking/carrier_pose.hpp"
#include "tests/support/pose_error.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::carrier_test {

using Matrix6 = cv::Matx<double, 6, 6>;

// The table, and a tray with two tags held before it.
struct Held {
  TagScene scene = table();
  set::Tracking settings = settings_for(scene);
  glm::dmat4 world_from_tray{1};
  set::Carrier tray{"tray", {flat_tag(10, 0.06, {0, 0, 0}), flat_tag(11, 0.06, {0.09, 0, 0}, 0.5)}};

  Held() { settings.carriers = {tray}; }

  // With the tray in the picture as well.
  TagScene seen() const {
    TagScene result = scene;
    for (set::Tag tag : tray.tags) {
      tag.world_from_tag = world_from_tray * tag.world_from_tag;
      result.tags.push_back(tag);
    }
    return result;
  }
};

glm::dmat4 placed(const glm::dvec3& position, double tilt_rad) {
  return glm::rotate(glm::translate(glm::dmat4(1), position), tilt_rad,
                     glm::normalize(glm::dvec3(1, 0.4, 0.2)));
}

TEST(Carriers, AreFoundWhereTheyAre) {
  Held held;
  held.world_from_tray = placed({-0.02, -0.25, 0.08}, 0.3);
  const Track track = track_once(held.settings, held.seen(), 1);
  ASSERT_EQ(track.status, TrackStatus::tracked) << track.reason;
  EXPECT_EQ(track.pose->tags, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(track.seen_tags, (std::vector<int>{0, 1, 2, 10, 11}));
  EXPECT_EQ(track.reason, "");  // no stranger
  ASSERT_EQ(track.carriers.size(), 1u);
  const CarrierTrack& tray = track.carriers[0];
  ASSERT_TRUE(tray.pose) << tray.reason;
  EXPECT_EQ(tray.pose->tags, (std::vector<int>{10, 11}));
  Pose as_pose;  // for the fixture's measures
  as_pose.covariance = tray.pose->covariance;
  EXPECT_LT(distance(tray.pose->world_from_carrier, held.world_from_tray),
            5 * translation_sigma(as_pose));
  EXPECT_LT(angle_between(tray.pose->world_from_carrier, held.world_from_tray),
            5 * rotation_sigma(as_pose));
  EXPECT_LT(translation_sigma(as_pose), 0.004);
}

// Normalised errors of n pictures: their mean is 6, or less where the model error of 0.03 px is
// more than the noise; its standard error sqrt(12/n).
TEST(Carriers, CovarianceHoldsOnPictures) {
  Held held;
  held.scene.lens = test::plain_lens(320, 240, 300);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  double sum = 0;
  int found = 0;
  constexpr int trials = 24;
  for (int trial = 0; trial < trials; ++trial) {
    held.world_from_tray = placed({0.03 * unit(random) - 0.02, -0.25, 0.08 + 0.03 * unit(random)},
                                  0.3 + 0.2 * unit(random));
    const auto tracker = make_apriltag_tracker(held.settings, held.scene.lens);
    const Track track = tracker->track(picture(held.seen(), random, 200));
    if (!track.carriers[0].pose) continue;
    ++found;
    const CarrierPose& pose = *track.carriers[0].pose;
    sum += square_in_sigmas(pose.covariance, pose.world_from_carrier, held.world_from_tray);
  }
  EXPECT_GE(found, trials * 3 / 4);
  EXPECT_LT(sum / found, 6 + 4 * std::sqrt(12.0 / found));
}

TEST(Carriers, ThatAreNotInThePictureAreNotGuessed) {
  const Held held;
  const Track track = track_once(held.settings, held.scene, 2);
  EXPECT_EQ(track.status, TrackStatus::tracked);
  ASSERT_EQ(track.carriers.size(), 1u);
  EXPECT_FALSE(track.carriers[0].pose);
  EXPECT_EQ(track.carriers[0].reason, "none of its tags in the picture");
}

// A carrier alone says nothing of the stage.
TEST(Carriers, DoNotFindTheCamera) {
  Held held;
  held.world_from_tray = placed({-0.02, -0.25, 0.08}, 0.3);
  TagScene seen = held.seen();
  seen.tags.erase(seen.tags.begin(), seen.tags.begin() + 3);
  const Track track = track_once(held.settings, seen, 3);
  EXPECT_EQ(track.status, TrackStatus::lost);
  EXPECT_EQ(track.reason, "no tag of this set in the picture");
  EXPECT_FALSE(track.carriers[0].pose);
}

TEST(Carriers, TagsAreInTheSetOnce) {
  Held held;
  held.settings.carriers.push_back({"stick", {flat_tag(1, 0.06, {0, 0, 0})}});
  const std::string refusal =
      test::error_of([&] { make_apriltag_tracker(held.settings, held.scene.lens); });
  EXPECT_THAT(refusal, HasSubstr("tag 1 of \"stick\""));
}

// By hand: a camera 1 m along the carrier's Z turns by w about X. The carrier turns as much, and
// its origin moves by (0,0,1) x (w,0,0) = (0,w,0).
TEST(Carriers, ALeverTurnsAngleIntoPlace) {
  Pose on_stage, on_carrier;
  on_carrier.world_from_camera = glm::translate(glm::dmat4(1), {0, 0, 1});
  on_carrier.covariance[0] = 3e-6;
  on_stage.covariance[0] = 1e-6;
  const CarrierPose pose = carrier_pose(on_stage, on_carrier);
  EXPECT_EQ(pose.world_from_carrier[3], glm::dvec4(0, 0, -1, 1));
  Matrix6 expected = Matrix6::zeros();
  expected(0, 0) = expected(4, 4) = expected(0, 4) = expected(4, 0) = 4e-6;
  for (int i = 0; i < 36; ++i) EXPECT_NEAR(pose.covariance[i], expected.val[i], 1e-20) << i;
}

}  // namespace previz::tracking::carrier_test
