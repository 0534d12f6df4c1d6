// The GPU goes away in the middle of a take (lose_device_layer.cpp): reopening it, pictures
// come back, and the take has every frame.
#include "tests/support/environment_variable.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::device_lost_test {

// A rig whose GPU can be taken away and given back, for which only a CPU device is left meanwhile.
class RigWithoutItsGpu : public test::RigLive {
 protected:
  void SetUp() override { write_set(); }
  void hide_gpu() { std::ofstream(hidden_).put('x'); }
  void give_gpu_back() { std::filesystem::remove(hidden_); }
  void lose_device() { std::ofstream(lose_).put('x'); }
  // Waits for a plate, and from it on for so many pictures, the last of which is a plate as well.
  void until_plates(int pictures) {
    const auto is_plate = [](const Shown& s) { return s.shot.untouched == "no graphics card"; };
    const int first = until(is_plate).count;
    until([&](const Shown& s) { return s.count >= first + pictures - 1 && is_plate(s); });
  }
  // Every frame that was captured was rendered or is counted, those that were lost with the device
  // among them.
  void expect_losses(std::uint64_t count) const {
    EXPECT_EQ(metrics_.counts.at("device lost"), count) << log_.text();
    EXPECT_EQ(metrics_.counts.at("device reopened"), count) << log_.text();
    EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
  }

  const std::filesystem::path lose_ = directory_ / "lose", hidden_ = directory_ / "hidden";
  const test::EnvironmentVariable lose_variable_{"PREVIZ_LOSE_DEVICE", lose_};
  const test::EnvironmentVariable hide_variable_{"PREVIZ_HIDE_GPU", hidden_};
};

TEST_F(RigWithoutItsGpu, ShowsPlatesAndRecordsUntilItIsBackAndTakesNoCpu) {
  run([&] {
    until_rendered(2);
    press("record");
    hide_gpu();
    lose_device();
    until_plates(1);
    const int rendered = rendered_pictures();
    until_plates(30);
    EXPECT_EQ(rendered_pictures(), rendered) << "the CPU has drawn";
    give_gpu_back();
    until_rendered(3);
    press("record");
    until_rendered(2);
  });
  expect_losses(1);
  EXPECT_THAT(log_.text(), HasSubstr("waiting for a GPU"));
  EXPECT_GT(test::unbroken(take_folder()).size(), 30u);
}

// A driver may hang where the device is opened anew. That is no time in which it is waited for.
TEST_F(RigWithoutItsGpu, IsKnownToHangWhereItHangsAsItIsOpened) {
  const std::filesystem::path hang = directory_ / "hang";
  const test::EnvironmentVariable variable("PREVIZ_HANG_DEVICE", hang);
  options_.patience.render = std::chrono::seconds(4);
  run([&] {
    until_rendered(2);
    std::ofstream(hang).put('x');
    lose_device();
    until_said("reopening it");
    const std::string before = log_.text();  // a slow machine may have missed a picture before
    const auto is_known = [&] {
      return log_.text().find("stopped responding: render", before.size()) != std::string::npos;
    };
    EXPECT_TRUE(test::wait_until("the hang is reported", is_known, std::chrono::seconds(20)));
    std::filesystem::remove(hang);
    until_rendered(2);
  });
}

class RigWithCpuInstead : public RigWithoutItsGpu {
 protected:
  void SetUp() override {
    write_set();
    replace_in_set("[quality]\n", "[quality]\ncpu_instead = true\n");
  }
};

TEST_F(RigWithCpuInstead, DrawsOnTheCpuBecauseTheSetSaysSo) {
  run([&] {
    until_rendered(2);
    hide_gpu();
    lose_device();
    while (std::filesystem::exists(lose_)) until_rendered(1);
    until_rendered(3);
  });
  EXPECT_THAT(log_.text(), HasSubstr("rendering again, on llvmpipe (CPU)"));
}

// What the rig had is remembered: after a crash, and when the GPU's module comes later than the
// service at boot.
TEST_F(RigWithoutItsGpu, StartsWithoutItAndWaitsForItIfItHadOneBefore) {
  const test::EnvironmentVariable state("STATE_DIRECTORY", directory_.path());
  run([&] { until_rendered(1); });
  EXPECT_TRUE(std::filesystem::exists(directory_ / "graphics-device"));
  hide_gpu();
  run([&] {
    until_plates(5);
    EXPECT_THAT(log_.text(), Not(HasSubstr("live on llvmpipe (CPU)")));
    give_gpu_back();
    until_rendered(2);
  });
  EXPECT_THAT(log_.text(), HasSubstr("live on no graphics card yet"));
}

// A service may not open a card whose module came after it: it is started again, but in no take.
TEST_F(RigWithoutItsGpu, StartsAgainWhereTheModuleOfItsCardCameLaterThanItself) {
  const test::EnvironmentVariable state("STATE_DIRECTORY", directory_.path());
  run([&] { until_rendered(1); });
  hide_gpu();
  std::atomic<bool> has_new_devices = false;
  options_.has_new_devices = [&] { return has_new_devices.load(); };
  run([&] {
    until_plates(1);
    press("record");
    until_said("button record: recording\n");
    has_new_devices = true;
    until_plates(60);  // two seconds, in which it would end
    EXPECT_FALSE(said("is restarting to open"));
    press("record");
    until_said("is restarting to open");
  });
  EXPECT_TRUE(session::open_session(take_folder()).missing.empty());
}

TEST_F(RigWithoutItsGpu, GoesOnThoughTheKernelHasNewDevicesWhereItsCardIsOpen) {
  options_.has_new_devices = [] { return true; };
  run([&] { until_rendered(40); });
  EXPECT_FALSE(said("is restarting to open"));
}

TEST_F(RigWithoutItsGpu, StartsOnTheCpuIfItNeverHadOne) {
  const test::EnvironmentVariable state("STATE_DIRECTORY", directory_.path());
  hide_gpu();
  run([&] { until_rendered(1); });
  EXPECT_THAT(log_.text(), HasSubstr("live on llvmpipe (CPU)"));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "graphics-device"));
}

// A box whose driver is not installed, or is being upgraded.
TEST_F(RigWithoutItsGpu, RecordsWithoutAnyDriverAndDrawsOnceThereIsOne) {
  const test::EnvironmentVariable state("STATE_DIRECTORY", directory_.path());
  std::optional<test::EnvironmentVariable> no_driver(std::in_place, "VK_ICD_FILENAMES",
                                                     directory_ / "none");
  run([&] {
    until_plates(1);
    press("record");
    until_plates(10);
    no_driver.reset();
    until_rendered(2);
    end_take();
  });
  EXPECT_TRUE(said("no graphics card; takes can be recorded")) << log_.text();
  EXPECT_TRUE(session::open_session(take_folder()).missing.empty());
}

class RigDeviceLost : public RigWithoutItsGpu {
 protected:
  void SetUp() override { write_set("composite = true\n"); }

  // Loses the device twice in a take.
  void lose_it_in_a_take() {
    run([&] {
      begin_take();
      for (int times = 0; times < 2; ++times) {
        until_rendered(3);
        lose_device();
        while (std::filesystem::exists(lose_)) until_rendered(1);
      }
      until_rendered(4);
    });
    expect_losses(2);
    EXPECT_THAT(log_.text(), HasSubstr("ErrorDeviceLost"));
    EXPECT_GT(test::unbroken(take_folder()).size(), 8u);
  }
};

TEST_F(RigDeviceLost, PicturesComeBackAndTheTakeLacksNothing) {
  lose_it_in_a_take();

  // recording.composite: what was shown in the meantime.
  session::Session take = session::open_session(take_folder());
  const auto shown = session::open_stream(take, "composite");
  ASSERT_TRUE(shown);
  ASSERT_GE(shown->records().size(), 8u);
  EXPECT_EQ(shown->width(), 48);
  EXPECT_EQ(shown->read(0)->format, PixelFormat::rgb8);
}

// Two frames are lost with the device: the one whose picture is waited for, and the next one.
TEST_F(RigDeviceLost, CountsBothFramesThatItWasAtWorkOn) {
  options_.device.as_gpu = true;
  lose_it_in_a_take();
  EXPECT_FALSE(metrics_.stages.at("render").dropped.contains("failed"));
}

}  // namespace previz::rig::device_lost_test

// The layer must be known before the first instance is made.
int main(int argc, char** argv) {
  setenv("VK_LAYER_PATH", PREVIZ_LAYERS, 1);
  setenv("VK_INSTANCE_LAYERS", "VK_LAYER_PREVIZ_lose_device", 1);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
