// On a graphics card the next frame is begun before the picture of the last one is there. What is
// shown, refined and saved is what it was.
#include "tests/support/live_rig.hpp"

namespace previz::rig::overlap_test {

class RigAsAGraphicsCard : public test::RigLive {
 protected:
  void SetUp() override {
    write_set("", 1'000'000);  // a camera that is faster than any card
    options_.device.as_gpu = true;
    options_.device.times_passes = true;
    while_shown_ = [this] {
      const Shown shown = shown_now();
      if (shown.shot.frozen) return;
      const std::int64_t time = shown.shot.frame->timestamp_ns;
      EXPECT_GT(time, last_ns_) << "picture " << shown.count;
      last_ns_ = time;
    };
  }

  std::int64_t last_ns_ = 0;
};

TEST_F(RigAsAGraphicsCard, ShowsEveryPictureInItsOrderAndRefines) {
  run_rendering([&] {
    until_rendered(6);
    press("refine");
    until_frozen(8);
    press("snapshot");
    until_mode(Mode::live);
    until_rendered(3);
  });
  EXPECT_TRUE(std::filesystem::exists(directory_ / "live/snapshot_0001.png"));
  EXPECT_FALSE(metrics_.stages.at("render").dropped.contains("failed"));
  EXPECT_GT(metrics_.counts.at("begun before the last picture was there"), 0u);
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
  EXPECT_THAT(log_.text(), Not(HasSubstr("has failed")));
  EXPECT_GT(metrics_.devices.at("graphics").at("submissions"), 8u);
  EXPECT_GT(metrics_.devices.at("graphics").at("bytes up"), 0u);
  EXPECT_GE(metrics_.passes.at("present").runs, 8u);
}

}  // namespace previz::rig::overlap_test
