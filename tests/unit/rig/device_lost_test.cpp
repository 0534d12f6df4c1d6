// The GPU goes away in the middle of a take (lose_device_layer.cpp): reopening it, pictures
// come back, and the take has every frame.
#include "daemon/rig/live.hpp"
#include "drivers/session/session.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::device_lost_test {

using pipeline::Shot;

// What is shown, for a thread that waits for something.
class Display {
 public:
  void show(const Shot& shot, const Look& look) {
    const std::lock_guard lock(mutex_);
    ++shown_;
    recorded_ += look.state.recording && shot.samples > 0 ? 1 : 0;
    rendered_ += shot.samples > 0 ? 1 : 0;
    plates_ += shot.untouched == "no graphics card" ? 1 : 0;
    changed_.notify_all();
  }
  int recorded() const {
    const std::lock_guard lock(mutex_);
    return recorded_;
  }
  int rendered() const {
    const std::lock_guard lock(mutex_);
    return rendered_;
  }
  void until_rendered(int more) { until_more(rendered_, more, "rendered pictures"); }
  void until_plates(int more) { until_more(plates_, more, "plates"); }
  void until_recorded(int pictures) {
    std::unique_lock lock(mutex_);
    test::await(
        changed_, lock, [&] { return recorded_ >= pictures; },
        [&] { return std::to_string(recorded_) + " pictures in the take"; });
  }

 private:
  void until_more(const int& count, int more, const char* of_what) {
    std::unique_lock lock(mutex_);
    const int wanted = count + more;
    test::await(
        changed_, lock, [&] { return count >= wanted; },
        [&] { return std::to_string(count) + " " + of_what; });
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int shown_ = 0, recorded_ = 0, rendered_ = 0, plates_ = 0;
};

// Environment variables of this process while it lives.
class Variable {
 public:
  Variable(const char* name, const std::filesystem::path& value) : name_(name) {
    setenv(name, value.c_str(), 1);
  }
  ~Variable() { unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
};

// A rig whose GPU can be taken away and given back, for which only a CPU device is left meanwhile.
class RigWithoutItsGpu : public testing::Test {
 protected:
  void SetUp() override { test::write_small_take(directory_.path(), true, more_of_set_); }
  void hide_gpu() { std::ofstream(hidden_).put('x'); }
  void give_gpu_back() { std::filesystem::remove(hidden_); }
  void lose_device() {
    std::ofstream(lose_).put('x');
    display_.until_plates(1);
  }
  bool said(const std::string& words) const { return log_.text().find(words) != std::string::npos; }
  pipeline::MetricsSnapshot run(const std::function<void()>& crew) {
    LiveOptions options = options_;
    options.on_shown = [&](const Shot& shot, const Look& look) { display_.show(shot, look); };
    std::ostream out(&log_);
    return test::run_crewed(std::move(options), directory_.path(), hand_, crew, out);
  }

  std::string more_of_set_ =
      "[recording]\nslate = \"1\"\nreserve_mb = 1\n" + test::button_for_every_action();
  const test::TemporaryDirectory directory_;
  const std::filesystem::path lose_ = directory_ / "lose", hidden_ = directory_ / "hidden";
  const Variable lose_variable_{"PREVIZ_LOSE_DEVICE", lose_};
  const Variable hide_variable_{"PREVIZ_HIDE_GPU", hidden_};
  Display display_;
  test::Hand hand_;
  LiveOptions options_;
  test::Log log_;
};

TEST_F(RigWithoutItsGpu, ShowsPlatesAndRecordsUntilItIsBackAndTakesNoCpu) {
  const pipeline::MetricsSnapshot metrics = run([&] {
    display_.until_rendered(2);
    hand_.press("record");
    hide_gpu();
    lose_device();
    const int rendered = display_.rendered();
    display_.until_plates(30);
    EXPECT_EQ(display_.rendered(), rendered) << "the CPU has drawn";
    give_gpu_back();
    display_.until_rendered(3);
    hand_.press("record");
    display_.until_rendered(2);
  });
  EXPECT_EQ(metrics.counts.at("device lost"), 1u) << log_.text();
  EXPECT_EQ(metrics.counts.at("device reopened"), 1u) << log_.text();
  EXPECT_THAT(log_.text(), HasSubstr("waiting for a GPU"));
  EXPECT_EQ(test::accounted_for(metrics), metrics.stages.at("observer").frames);
  session::Session take = session::open_session(directory_ / "takes/1_take001");
  const auto stream = session::open_stream(take, "observer");
  const auto& records = stream->records();
  ASSERT_GT(records.size(), 30u);
  for (std::size_t i = 0; i < records.size(); ++i)
    EXPECT_EQ(records[i].sequence, records[0].sequence + i);
}

// A driver may hang where the device is opened anew. That is no time in which it is waited for.
TEST_F(RigWithoutItsGpu, IsKnownToHangWhereItHangsAsItIsOpened) {
  const std::filesystem::path hang = directory_ / "hang";
  const Variable variable("PREVIZ_HANG_DEVICE", hang);
  options_.patience.render = std::chrono::seconds(4);
  run([&] {
    display_.until_rendered(2);
    std::ofstream(hang).put('x');
    std::ofstream(lose_).put('x');
    test::must_come("the device is lost", [&] { return said("reopening it"); });
    const std::string before = log_.text();  // a slow machine may have missed a picture before
    const auto is_known = [&] {
      return log_.text().find("stopped responding: render", before.size()) != std::string::npos;
    };
    EXPECT_TRUE(test::wait_until("the hang is reported", is_known, std::chrono::seconds(20)));
    std::filesystem::remove(hang);
    display_.until_rendered(2);
  });
}

class RigWithCpuInstead : public RigWithoutItsGpu {
 protected:
  RigWithCpuInstead() { more_of_set_.insert(0, "cpu_instead = true\n"); }
};

TEST_F(RigWithCpuInstead, DrawsOnTheCpuBecauseTheSetSaysSo) {
  run([&] {
    display_.until_rendered(2);
    hide_gpu();
    std::ofstream(lose_).put('x');
    while (std::filesystem::exists(lose_)) display_.until_rendered(1);
    display_.until_rendered(3);
  });
  EXPECT_THAT(log_.text(), HasSubstr("rendering again, on llvmpipe (CPU)"));
}

// What the rig had is remembered: after a crash, and when the GPU's module comes later than the
// service at boot.
TEST_F(RigWithoutItsGpu, StartsWithoutItAndWaitsForItIfItHadOneBefore) {
  const Variable state("STATE_DIRECTORY", directory_.path());
  run([&] { display_.until_rendered(1); });
  EXPECT_TRUE(std::filesystem::exists(directory_ / "graphics-device"));
  hide_gpu();
  run([&] {
    display_.until_plates(5);
    EXPECT_THAT(log_.text(), Not(HasSubstr("live on llvmpipe (CPU)")));
    give_gpu_back();
    display_.until_rendered(2);
  });
  EXPECT_THAT(log_.text(), HasSubstr("live on no graphics card yet"));
}

// A service may not open a card whose module came after it: it is started again, but in no take.
TEST_F(RigWithoutItsGpu, StartsAgainWhereTheModuleOfItsCardCameLaterThanItself) {
  const Variable state("STATE_DIRECTORY", directory_.path());
  run([&] { display_.until_rendered(1); });
  hide_gpu();
  std::atomic<bool> has_new_devices = false;
  options_.has_new_devices = [&] { return has_new_devices.load(); };
  run([&] {
    display_.until_plates(1);
    hand_.press("record");
    test::must_come("a take begins", [&] { return said("button record: recording\n"); });
    has_new_devices = true;
    display_.until_plates(60);  // two seconds, in which it would end
    EXPECT_FALSE(said("is restarting to open"));
    hand_.press("record");
    test::must_come("the rig starts again", [&] { return said("is restarting to open"); });
  });
  EXPECT_TRUE(session::open_session(directory_ / "takes/1_take001").missing.empty());
}

TEST_F(RigWithoutItsGpu, GoesOnThoughTheKernelHasNewDevicesWhereItsCardIsOpen) {
  options_.has_new_devices = [] { return true; };
  run([&] { display_.until_rendered(40); });
  EXPECT_FALSE(said("starts again"));
}

TEST_F(RigWithoutItsGpu, StartsOnTheCpuIfItNeverHadOne) {
  const Variable state("STATE_DIRECTORY", directory_.path());
  hide_gpu();
  run([&] { display_.until_rendered(1); });
  EXPECT_THAT(log_.text(), HasSubstr("live on llvmpipe (CPU)"));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "graphics-device"));
}

// A box whose driver is not installed, or is being upgraded.
TEST_F(RigWithoutItsGpu, RecordsWithoutAnyDriverAndDrawsOnceThereIsOne) {
  const Variable state("STATE_DIRECTORY", directory_.path());
  std::optional<Variable> no_driver(std::in_place, "VK_ICD_FILENAMES", directory_ / "none");
  run([&] {
    display_.until_plates(1);
    hand_.press("record");
    display_.until_plates(10);
    no_driver.reset();
    display_.until_rendered(2);
    hand_.press("record");
    test::must_come("the take ends", [&] { return said("1_take001 is finished"); });
  });
  EXPECT_TRUE(said("no graphics card; takes can be recorded")) << log_.text();
  EXPECT_TRUE(session::open_session(directory_ / "takes/1_take001").missing.empty());
}

TEST(RigDeviceLost, PicturesComeBackAndTheTakeLacksNothing) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path order = directory / "lose";
  setenv("PREVIZ_LOSE_DEVICE", order.c_str(), 1);
  test::write_small_take(directory.path(), true,
                         "[recording]\nslate = \"1\"\nreserve_mb = 1\ncomposite = true\n"
                         "[[button]]\nname = \"red\"\naction = \"record\"\n");
  const std::int64_t start = test::small_take_frame(0).timestamp_ns;
  std::ofstream events(directory / "session/events.jsonl");
  for (const auto& [ms, pushed] : {std::pair(100, "true"), {120, "false"}})
    events << "{\"timestamp_ns\":" << start + ms * 1'000'000
           << ",\"button\":\"red\",\"pressed\":" << pushed << "}\n";
  events.close();

  Display display;
  std::ostringstream out;
  LiveOptions options;
  options.on_shown = [&](const Shot& shot, const Look& look) { display.show(shot, look); };
  const auto crew = [&] {
    for (int times = 0; times < 2; ++times) {  // and again
      display.until_recorded(display.recorded() + 3);
      std::ofstream(order).put('x');
      while (std::filesystem::exists(order)) display.until_recorded(display.recorded() + 1);
    }
    display.until_recorded(display.recorded() + 4);
  };
  test::Hand nobody;
  const pipeline::MetricsSnapshot metrics =
      test::run_crewed(std::move(options), directory.path(), nobody, crew, out);
  EXPECT_EQ(metrics.counts.at("device lost"), 2u) << out.str();
  EXPECT_EQ(metrics.counts.at("device reopened"), 2u);
  EXPECT_THAT(out.str(), HasSubstr("ErrorDeviceLost"));

  // Captured = rendered + dropped by cause, the frames that were lost with the device too.
  EXPECT_EQ(test::accounted_for(metrics), metrics.stages.at("observer").frames);

  session::Session take = session::open_session(directory / "takes/1_take001");
  EXPECT_TRUE(take.missing.empty());
  const auto stream = session::open_stream(take, "observer");
  const auto& records = stream->records();
  ASSERT_GT(records.size(), 8u);
  for (std::size_t i = 0; i < records.size(); ++i)
    EXPECT_EQ(records[i].sequence, records[0].sequence + i);

  // recording.composite: what was shown in the meantime.
  const auto shown = session::open_stream(take, "composite");
  ASSERT_TRUE(shown);
  ASSERT_GE(shown->records().size(), 8u);
  EXPECT_EQ(shown->width(), 48);
  EXPECT_EQ(shown->read(0)->format, PixelFormat::rgb8);
}

}  // namespace previz::rig::device_lost_test

// The layer must be known before the first instance is made.
int main(int argc, char** argv) {
  setenv("VK_LAYER_PATH", PREVIZ_LAYERS, 1);
  setenv("VK_INSTANCE_LAYERS", "VK_LAYER_PREVIZ_lose_device", 1);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
