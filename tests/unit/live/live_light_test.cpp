// The light beside the live pictures, and what is odd about a picture, without a rig.
#include "daemon/core/live/live_light.hpp"

#include "daemon/core/live/live_output.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::live::live_light_test {

class LiveLightTest : public testing::Test {
 protected:
  LiveLightTest() { set_.file = "stage.toml"; }

  LiveLight::Parts parts() {
    return {set_,
            scene_,
            look_,
            {.reports = reports_,
             .metrics = metrics_,
             .liveness = liveness_,
             .rehearse =
                 [this](const std::string&) {
                   if (fails_.exchange(false)) throw Error("lamp fell down");
                 },
             .delays = {std::chrono::milliseconds(1), std::chrono::milliseconds(1)}}};
  }
  static LightCameraCalibration camera() {
    LightCameraCalibration camera = test::fisheye_camera(32);
    camera.world_from_camera = test::looking(0, 90);
    return camera;
  }
  static FramePtr grey(int size, std::uint64_t sequence, double exposure = 1) {
    Frame frame = *test::make_frame(
        size, size, exposure,
        std::vector<glm::dvec3>(std::size_t(size) * std::size_t(size), glm::dvec3(0.5)));
    frame.sequence = sequence;
    return std::make_shared<Frame>(std::move(frame));
  }
  // Runs the light camera's stages over these frames to their end; returns the light there is then.
  pipeline::LightPtr run(
      LiveLight& light, std::vector<FramePtr> frames,
      const std::function<void(const Frame&)>& before = [](const Frame&) {}) {
    pipeline::StageThreads stages(metrics_, {});
    light.start(stages, [&, next = std::size_t{0}]() mutable -> FramePtr {
      if (next == frames.size()) return nullptr;
      before(*frames[next]);
      return frames[next++];
    });
    stages.wait();
    return light.light_for({}, set::LightMode::image);
  }

  std::atomic<bool> fails_ = false;  // the next estimate does
  set::Set set_;
  scene::Scene scene_;
  pipeline::Newest<Look> look_{Look{}};
  std::ostringstream log_;
  report::Reports reports_{report::lines_to(log_)};
  pipeline::Metrics metrics_;
  pipeline::Liveness liveness_;
};

TEST_F(LiveLightTest, IsMadeOfTheLightCamerasFrames) {
  LiveLight light(parts(), camera(), ObserverCalibration{});
  EXPECT_TRUE(light.needs_frames());
  EXPECT_EQ(light.light_for({}, set::LightMode::image), nullptr);  // none was seen yet
  const pipeline::LightPtr seen = run(light, {grey(32, 3)});
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->sequences, std::vector<std::uint64_t>{3});
  EXPECT_TRUE(reports_.troubles().empty());
}

TEST_F(LiveLightTest, AFrameThatCannotBeUsedIsReportedShownAndCounted) {
  LiveLight light(parts(), camera(), ObserverCalibration{});
  EXPECT_EQ(run(light, {grey(8, 1), grey(8, 2)}), nullptr);
  EXPECT_EQ(log_.str().find("light: light frame 1 is skipped"), 0u) << log_.str();
  EXPECT_THAT(log_.str(), Not(HasSubstr("light frame 2"))) << "said twice";
  EXPECT_EQ(metrics_.snapshot(1).stages.at("lighting").dropped.at("not usable"), 2u);
  ASSERT_EQ(reports_.troubles().size(), 1u);
  EXPECT_EQ(reports_.troubles()[0].source, "light");
  EXPECT_FALSE(reports_.troubles()[0].lasts);
}

// After a failure, too, the light of one exposure alone is not shown: it may be clipped or noise.
TEST_F(LiveLightTest, AWholeBracketIsAwaitedAgainAfterAFailure) {
  for (const std::size_t more : {1, 3}) {
    std::vector<FramePtr> frames{grey(32, 1, 1), grey(32, 2, 0.25), grey(32, 3, 1), grey(32, 4, 4)};
    frames.resize(1 + more);
    LiveLight light(parts(), camera(), ObserverCalibration{});
    light.await_bracket(3);
    fails_ = true;
    const pipeline::LightPtr seen = run(light, frames, [&](const Frame& next) {
      if (next.sequence != 2) return;
      EXPECT_TRUE(test::wait_until("the first estimate has failed", [&] { return !fails_; }));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));  // the rest after it is over
    });
    EXPECT_EQ(seen ? seen->sequences.size() : 0, more == 3 ? 3u : 0u);
  }
}

TEST_F(LiveLightTest, RestsWithTracking) {
  Look refining;
  refining.state.mode = Mode::refine;
  look_.set(refining);
  LiveLight light(parts(), camera(), ObserverCalibration{});
  EXPECT_EQ(run(light, {grey(32, 1)}), nullptr);
}

TEST_F(LiveLightTest, ASetsOwnLightNeedsNoFrames) {
  set_.lighting.from = set::LightFrom::set;
  LiveLight light(parts(), {}, ObserverCalibration{});
  EXPECT_FALSE(light.needs_frames());
  EXPECT_TRUE(light.light_for({}, set::LightMode::image));
  run(light, {grey(32, 1)});  // there to be recorded
  EXPECT_EQ(metrics_.snapshot(1).stages.at("light camera").frames, 1u);
}

TEST(CountPicture, WhatIsOddIsCountedAndReportedOnce) {
  std::ostringstream log;
  report::Reports reports(report::lines_to(log));
  pipeline::Metrics metrics;
  pipeline::Shot shot;
  count_picture(shot, metrics, reports);
  EXPECT_TRUE(metrics.snapshot(1).counts.empty());
  shot.untouched = "pose lost: no tag in the picture";
  shot.counters.dropped_negative = 3;
  shot.counters.unfinished = 2;
  shot.counters.rebuilt_trees = 1;
  for (int times = 0; times < 2; ++times) count_picture(shot, metrics, reports);
  EXPECT_EQ(metrics.snapshot(1).counts.at("plate untouched: " + shot.untouched), 2u);
  EXPECT_EQ(metrics.snapshot(1).counts.at("negative samples"), 6u);
  EXPECT_EQ(metrics.snapshot(1).counts.at("non-finite samples"), 0u);
  EXPECT_EQ(metrics.snapshot(1).counts.at("paths cut short"), 4u);
  EXPECT_EQ(metrics.snapshot(1).counts.at("trees of deforming meshes rebuilt"), 2u);
  EXPECT_EQ(log.str(), "plate untouched: pose lost: no tag in the picture\n");
  for (const char* reason : {"no pose fits tags 3 and 17", "no pose fits tags 4 and 8"}) {
    shot.untouched = reason;
    count_picture(shot, metrics, reports);
  }
  EXPECT_EQ(metrics.snapshot(1).counts.at("plate untouched: no pose fits tags  and "), 2u);
}

}  // namespace previz::live::live_light_test
