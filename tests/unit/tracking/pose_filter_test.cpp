// The pose that live pictures show: calm at rest, on time in motion, without jumps, and there while
// the tags are covered for a moment.
#include "daemon/core/tracking/pose_filter.hpp"

#include "tests/support/pose_error.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::pose_filter_test {

constexpr double sigma_rad = 1e-4, sigma_m = 1e-4;

glm::dmat4 moved(const glm::dmat4& pose, const PoseError& by) {
  const glm::dvec3 w(by[0], by[1], by[2]);
  const double angle = glm::length(w);
  glm::dmat4 step(angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, w / angle)) : glm::dmat3(1));
  step[3] = {by[3], by[4], by[5], 1};
  return pose * step;
}

// A camera over the table, its poses with the noise that they state.
struct Shoot {
  TagScene scene = table();
  set::Tracking settings = settings_for(scene);
  PoseFilter filter{settings, scene.lens};
  std::mt19937 random{1};
  std::normal_distribution<double> normal;
  std::int64_t time_ns = 1'000'000'000;
  glm::dmat4 at = scene.world_from_camera;
  double fit_px = 0.02;  // how far the tags' corners are off those of their poses

  explicit Shoot(set::Tracking wish = settings_for(table())) : settings(std::move(wish)) {}

  // The next frame's track, with the camera at `at`.
  Track track(std::vector<int> tags = {0, 1, 2}, const PoseError& bias = {}, double noise = 1) {
    time_ns += kFrameNs;
    Track result;
    result.status = TrackStatus::tracked;
    result.pose.emplace();
    PoseError error = bias;
    for (int i = 0; i < 6; ++i) {
      const double sigma = noise * (i < 3 ? sigma_rad : sigma_m);
      result.pose->covariance[static_cast<std::size_t>(7 * i)] = sigma * sigma;
      error[i] += sigma * normal(random);
    }
    result.pose->world_from_camera = moved(at, error);
    result.pose->tags = std::move(tags);
    result.pose->reprojection_rms_px = fit_px;
    return result;
  }
  Track lost() {
    time_ns += kFrameNs;
    Track result;
    result.reason = "no tag in the picture";
    return result;
  }
  std::optional<ShownPose> show(const Track& track) { return filter.shown(track, time_ns); }
  void rest(int frames) {
    for (int i = 0; i < frames; ++i) show(track());
  }
};

// A hand's way: it starts, swings and stops, at up to 0.5 m/s and 0.6 rad/s.
glm::dmat4 hand_held(const glm::dmat4& start, double seconds) {
  const double phase = 6.2832 * 0.8 * std::clamp(seconds - 1, 0.0, 2.5);
  const double x = 0.1 * (1 - std::cos(phase)), turn = 0.12 * std::sin(phase);
  return moved(start, {0.3 * turn, turn, 0.1 * turn, x, 0.3 * x, 0.5 * x});
}

double step_size(const glm::dmat4& a, const glm::dmat4& b) {
  return std::sqrt(cv::norm(error_between(a, b), cv::NORM_L2SQR));
}

// Expects a pose that the filter calls no surprise. Angles are small: sin(x) = x to 1e-6 here.
void expect_no_surprise(const std::array<double, 36>& covariance, const glm::dmat4& from,
                        const glm::dmat4& to) {
  EXPECT_LE(square_in_sigmas(covariance, from, to), pose_surprise * (1 + 1e-3));
}

// After two seconds of rest a pose is the mean of many: what is left of the jitter from frame to
// frame is a small part of what the poses have.
TEST(PoseFilter, ACameraAtRestIsCalm) {
  Shoot shoot;
  shoot.rest(50);
  double raw = 0, shown = 0, off = 0;
  glm::dmat4 last_raw = shoot.at, last_shown = shoot.at;
  constexpr int frames = 100;
  for (int i = 0; i < frames; ++i) {
    const Track track = shoot.track();
    const std::optional<ShownPose> pose = shoot.show(track);
    ASSERT_TRUE(pose);
    EXPECT_EQ(pose->held_s, 0);
    if (i > 0) {
      raw += std::pow(step_size(last_raw, track.pose->world_from_camera), 2);
      shown += std::pow(step_size(last_shown, pose->world_from_camera), 2);
    }
    off += square_in_sigmas(track.pose->covariance, shoot.at, pose->world_from_camera) / 6;
    last_raw = track.pose->world_from_camera;
    last_shown = pose->world_from_camera;
  }
  std::printf("  jitter %.3f of the poses', error %.3f of their variance\n", std::sqrt(shown / raw),
              off / frames);
  EXPECT_LT(std::sqrt(shown / raw), 0.2);
  EXPECT_LT(off / frames, 0.5);
}

// In motion, and whenever it starts or stops, the shown pose stays within what the noise of one
// pose explains; this is the bound that the filter states.
TEST(PoseFilter, AMovingCameraIsFollowedWithinTheNoiseOfAPose) {
  Shoot shoot;
  const glm::dmat4 start = shoot.at;
  double worst = 0;
  for (int i = 0; i < 150; ++i) {
    shoot.at = hand_held(start, i * 1e-9 * kFrameNs);
    const Track track = shoot.track();
    const std::optional<ShownPose> pose = shoot.show(track);
    ASSERT_TRUE(pose);
    const double off = square_in_sigmas(track.pose->covariance, pose->world_from_camera,
                                        track.pose->world_from_camera);
    EXPECT_LE(off, pose_surprise * (1 + 1e-3)) << i;  // small angles: sin(x) = x to 1e-6 here
    worst = std::max(worst, off);
  }
  std::printf("  at most %.2f standard deviations off the pose\n", std::sqrt(worst));
}

// Tags that disagree by eight standard deviations make the pose jump, but not the picture: the step
// is within the expected covariance, an eighth of it is done a frame (1 - exp(-0.04 / 0.3), and the
// noise of the poses), and after two seconds it is the new pose.
TEST(PoseFilter, OtherTagsMakeNoJump) {
  Shoot shoot;
  shoot.fit_px = 0.2;  // the map is wrong by half a pixel
  shoot.rest(50);
  const PoseError bias(0, 8 * sigma_rad, 0, 8 * sigma_m, 0, 0);
  glm::dmat4 last = shoot.show(shoot.track())->world_from_camera;
  for (int i = 0; i < 50; ++i) {
    const Track track = shoot.track({1}, bias);
    const ShownPose expected = *shoot.filter.expected(shoot.time_ns);
    const glm::dmat4 shown = shoot.show(track)->world_from_camera;
    SCOPED_TRACE(i);
    expect_no_surprise(expected.covariance, expected.world_from_camera, shown);
    EXPECT_LT(step_size(last, shown), 0.2 * std::sqrt(bias.dot(bias)));
    last = shown;
  }
  const PoseError left = error_between(moved(shoot.at, bias), last);
  std::printf("  after two seconds %.2f of the step is left\n",
              std::sqrt(left.dot(left) / bias.dot(bias)));
  EXPECT_LT(std::sqrt(left.dot(left) / bias.dot(bias)), 0.2);
}

// A camera that begins to move in the frame in which another tag comes into view, or one goes out
// of it: the tags fit one map, so the step is the camera's, and the picture follows.
TEST(PoseFilter, AMotionIsNotLaidToAMapThatFits) {
  for (const std::vector<int>& tags : {std::vector<int>{0, 1, 2, 3}, {0, 1}}) {
    Shoot shoot;
    shoot.rest(50);
    shoot.at = moved(shoot.at, {0, 8 * sigma_rad, 0, 8 * sigma_m, 0, 0});
    const Track track = shoot.track(tags);
    const glm::dmat4 shown = shoot.show(track)->world_from_camera;
    expect_no_surprise(track.pose->covariance, shown, track.pose->world_from_camera);
  }
}

// A single far tag knows the pose ten times worse: its noise does not come into the picture.
TEST(PoseFilter, AWorsePoseCountsLess) {
  Shoot shoot;
  shoot.rest(50);
  for (int i = 0; i < 10; ++i) {
    const Track track = shoot.track({2}, {}, 10);
    const ShownPose expected = *shoot.filter.expected(shoot.time_ns);
    const ShownPose shown = *shoot.show(track);
    expect_no_surprise(expected.covariance, expected.world_from_camera, shown.world_from_camera);
    EXPECT_LT(step_size(shoot.at, shown.world_from_camera), 3 * sigma_m);
  }
}

// A hand over the tags: the picture stays, says for how long, and is lost after hold_s.
TEST(PoseFilter, HoldsWhileTheTagsAreCovered) {
  Shoot shoot;
  shoot.rest(50);
  int held = 0;
  for (int i = 1; i <= 20; ++i) {
    const std::optional<ShownPose> pose = shoot.show(shoot.lost());
    const bool in_time = i * kFrameNs <= 500'000'000;
    ASSERT_EQ(pose.has_value(), in_time) << i;
    if (!pose) continue;
    ++held;
    EXPECT_NEAR(pose->held_s, 1e-9 * i * kFrameNs, 1e-12);
    EXPECT_LT(square_in_sigmas(pose->covariance, pose->world_from_camera, shoot.at), 22.5) << i;
  }
  EXPECT_EQ(held, 12);
  // What comes back is shown as it is.
  const Track back = shoot.track();
  EXPECT_LT(step_size(shoot.show(back)->world_from_camera, back.pose->world_from_camera),
            4 * sigma_m);
}

TEST(PoseFilter, GoesOnWithAMotionWhileItIsLikely) {
  Shoot shoot;
  const PoseError step(0.004, 0.002, 0, 0.008, 0, 0.002);  // 0.2 m/s, 0.1 rad/s
  for (int i = 0; i < 50; ++i) {
    shoot.at = moved(shoot.at, step);
    shoot.show(shoot.track());
  }
  const glm::dmat4 before = shoot.at;
  for (int i = 0; i < 2; ++i) {
    shoot.at = moved(shoot.at, step);
    const std::optional<ShownPose> pose = shoot.show(shoot.lost());
    ASSERT_TRUE(pose);
    // The velocity fades with 0.25 s: of 0.08 s at most a sixth of the way is missing.
    EXPECT_LT(step_size(pose->world_from_camera, shoot.at), 0.25 * step_size(before, shoot.at));
  }
}

// A camera that was swung may be anywhere soon: it is given up before one that stood.
TEST(PoseFilter, GivesUpASwungCameraEarlier) {
  Shoot shoot;
  const glm::dmat4 start = shoot.at;
  for (int i = 0; i < 60; ++i) {
    shoot.at = hand_held(start, i * 1e-9 * kFrameNs);
    shoot.show(shoot.track());
  }
  int held = 0;
  while (held < 12 && shoot.show(shoot.lost())) ++held;
  std::printf("  held for %d frames\n", held);
  EXPECT_LT(held, 12);
  EXPECT_FALSE(shoot.show(shoot.lost()));
}

TEST(PoseFilter, ACutBeginsAnew) {
  Shoot shoot;
  shoot.rest(20);
  shoot.at = camera_looking({-0.4, -0.5, 0.5}, {0.02, 0.03, 0});
  Track cut = shoot.track();
  expect_no_surprise(cut.pose->covariance, shoot.show(cut)->world_from_camera,
                     cut.pose->world_from_camera);
  // So does a pause, after which the last pose says nothing.
  shoot.time_ns += 2'000'000'000;
  EXPECT_FALSE(shoot.show(shoot.lost()));
  cut = shoot.track({0}, {0, 0, 0, 0.01, 0, 0});
  EXPECT_EQ(shoot.show(cut)->world_from_camera, cut.pose->world_from_camera);
  // So does time that goes back.
  shoot.time_ns -= 1'000'000'000;
  cut = shoot.track({0}, {0, 0, 0, -0.01, 0, 0});
  EXPECT_EQ(shoot.show(cut)->world_from_camera, cut.pose->world_from_camera);
}

TEST(PoseFilter, DoesWhatTheSetAsksFor) {
  set::Tracking settings = settings_for(table());
  settings.smooth = false;
  Shoot held(settings);
  for (int i = 0; i < 30; ++i) EXPECT_FALSE(held.show(held.track()));
  EXPECT_TRUE(held.show(held.lost()));

  settings.hold_s = 0;
  Shoot plain(settings);
  for (int i = 0; i < 30; ++i) EXPECT_FALSE(plain.show(plain.track()));
  EXPECT_FALSE(plain.show(plain.lost()));
}

TEST(PoseFilter, KnowsNothingBeforeTheFirstPose) {
  Shoot shoot;
  EXPECT_FALSE(shoot.filter.expected(0));
  EXPECT_FALSE(shoot.show(shoot.lost()));
  const Track first = shoot.track();
  EXPECT_EQ(shoot.show(first)->world_from_camera, first.pose->world_from_camera);
  EXPECT_FALSE(shoot.show(shoot.lost())) << "no velocity is known yet";
}

// A tracker that states no covariance, or one that is broken, is shown as it says.
TEST(PoseFilter, PosesWithoutACovariance) {
  for (const double variance : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    Shoot shoot;
    const glm::dmat4 start = shoot.at;
    for (int i = 0; i < 10; ++i) {
      shoot.at = moved(start, {0.01 * i, 0, 0, 0.01 * (i % 3), 0, 0});
      Track track = shoot.track();
      track.pose->covariance.fill(variance);
      const std::optional<ShownPose> pose = shoot.show(track);
      ASSERT_TRUE(pose);
      EXPECT_LT(step_size(pose->world_from_camera, track.pose->world_from_camera), 1e-6);
    }
  }
}

}  // namespace previz::tracking::pose_filter_test
