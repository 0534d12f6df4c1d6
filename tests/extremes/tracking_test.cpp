// Tags at grazing angles, at the detection limit, and seen so that two poses explain them.
#include "tests/support/test.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::tracking_test {

// One small tag.
TagScene single_tag() {
  TagScene scene;
  scene.lens = test::plain_lens(240, 200, 450);
  scene.tags = {flat_tag(5, 0.08, {0, 0, 0})};
  return scene;
}

Track first_track(const TagScene& scene, const Frame& frame) {
  return make_apriltag_tracker(settings_for(scene), scene.lens)->track(frame);
}

// One small tag seen nearly face on, at many tilts: both poses explain it. Whatever is tracked must
// be the true one; the rest must say so and hold the truth among their candidates.
TEST(ExtremeTracking, NeverFlipsASingleTag) {
  TagScene scene = single_tag();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  int tracked = 0, ambiguous = 0;
  for (int t = 0; t < 60; ++t) {
    const double tilt = 0.7 * unit(random), around = 6.2832 * unit(random);
    const double range = 1.4 + 0.8 * unit(random);
    const glm::dvec3 eye = range * glm::dvec3(std::sin(tilt) * std::cos(around),
                                              std::sin(tilt) * std::sin(around), std::cos(tilt));
    scene.world_from_camera = camera_looking(eye, {0, 0, 0}, {0.2, 1, 0.1});
    const Track track = first_track(scene, picture(scene, random, 600));
    ASSERT_NE(track.status, TrackStatus::lost) << track.reason;
    if (track.status == TrackStatus::tracked) {
      ++tracked;
      EXPECT_LT(angle_between(track.pose->world_from_camera, scene.world_from_camera),
                5 * rotation_sigma(*track.pose) + 1e-3)
          << "tilt " << tilt << " range " << range;
    } else {
      ++ambiguous;
      EXPECT_FALSE(track.pose);
      ASSERT_GE(track.candidates.size(), 2u);
      EXPECT_TRUE(std::any_of(track.candidates.begin(), track.candidates.end(),
                              [&](const Pose& p) {
                                return angle_between(p.world_from_camera, scene.world_from_camera) <
                                       5 * rotation_sigma(p) + 1e-3;
                              }))
          << "tilt " << tilt;
    }
  }
  std::printf("  %d tracked, %d ambiguous\n", tracked, ambiguous);
  EXPECT_GT(tracked, 5);
  EXPECT_GT(ambiguous, 5);
}

// Known from a slanted view, a single tag stays known while it turns to where either pose would do.
TEST(ExtremeTracking, TheLastPoseDecidesWhileItIsRecent) {
  TagScene scene = single_tag();
  const auto place = [&](double tilt) {
    scene.world_from_camera =
        camera_looking({2 * std::sin(tilt), 0.1, 2 * std::cos(tilt)}, {0, 0, 0}, {0, 1, 0});
  };
  std::mt19937 random(8);
  const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens);
  const auto alone = make_apriltag_tracker(settings_for(scene), scene.lens);
  int decided = 0;
  std::int64_t time = 0;
  for (double tilt = 0.6; tilt > 0.08; tilt -= 0.02, time += kFrameNs) {
    place(tilt);
    Frame frame = picture(scene, random, 600);
    frame.timestamp_ns = time;
    alone->reset();
    const Track cold = alone->track(frame), track = tracker->track(frame);
    decided += cold.status == TrackStatus::ambiguous && track.status == TrackStatus::tracked;
    if (!track.pose) continue;
    EXPECT_LT(angle_between(track.pose->world_from_camera, scene.world_from_camera),
              5 * rotation_sigma(*track.pose));
  }
  std::printf("  decided %d frames that were ambiguous alone\n", decided);
  EXPECT_GT(decided, 3);
  // A second later the last pose says nothing.
  place(0.1);
  Frame late = picture(scene, random, 3000);
  late.timestamp_ns = time + 1'000'000'000;
  alone->reset();
  EXPECT_EQ(tracker->track(late).status, alone->track(late).status);
}

// From 45 degrees to edge on: no flip, a covariance that grows, and lost at the end.
TEST(ExtremeTracking, GrazingAngles) {
  TagScene scene = table();
  scene.lens.k1 = scene.lens.k2 = scene.lens.p1 = scene.lens.p2 = 0;
  std::mt19937 random(9);
  double first = 0, last = 0;
  TrackStatus status = TrackStatus::tracked;
  for (double elevation : {45.0, 25.0, 15.0, 10.0, 7.0, 5.0, 3.0, 1.0}) {
    const double e = glm::radians(elevation);
    scene.world_from_camera = camera_looking({0, -0.9 * std::cos(e), 0.9 * std::sin(e)}, {0, 0, 0});
    const Track track = first_track(scene, picture(scene, random));
    status = track.status;
    if (!track.pose) continue;
    const double sigma = translation_sigma(*track.pose);
    if (first == 0) first = sigma;
    last = sigma;
    EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera), 5 * sigma)
        << elevation;
    EXPECT_LT(angle_between(track.pose->world_from_camera, scene.world_from_camera),
              5 * rotation_sigma(*track.pose))
        << elevation;
  }
  EXPECT_EQ(status, TrackStatus::lost);
  EXPECT_GT(last, first);
}

// Farther and farther: the covariance grows, and beyond the detection limit it says lost.
TEST(ExtremeTracking, DetectionLimit) {
  TagScene scene = table();
  std::mt19937 random(10);
  double last = 0;
  TrackStatus status = TrackStatus::tracked;
  for (double range : {0.6, 1.2, 2.4, 4.8, 9.6}) {
    scene.world_from_camera = camera_looking({0.1, -0.8 * range, 0.6 * range}, {0.02, 0.03, 0});
    const Track track = first_track(scene, picture(scene, random));
    status = track.status;
    if (!track.pose) continue;
    EXPECT_GT(translation_sigma(*track.pose), last);
    last = translation_sigma(*track.pose);
    EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera), 5 * last) << range;
  }
  EXPECT_EQ(status, TrackStatus::lost);
}

}  // namespace previz::tracking::tracking_test
