// The GPU goes away in the middle of a take (lose_device_layer.cpp): it is opened again, pictures
// come back, and the take has every frame.
#include <gtest/gtest.h>

#include <condition_variable>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <sstream>

#include "daemon/rig/live.hpp"
#include "drivers/session/session.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::rig {
namespace rig_device_lost_test {

using pipeline::Shot;

// What is shown, for a thread that waits for something.
class Display {
 public:
  void show(const Shot& shot, const Look& look) {
    const std::lock_guard lock(mutex_);
    ++shown_;
    recorded_ += look.state.recording && shot.samples > 0 ? 1 : 0;
    changed_.notify_all();
  }
  int recorded() const {
    const std::lock_guard lock(mutex_);
    return recorded_;
  }
  void until_recorded(int pictures) {
    std::unique_lock lock(mutex_);
    test::await(
        changed_, lock, [&] { return recorded_ >= pictures; },
        [&] { return std::to_string(recorded_) + " pictures in the take"; });
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int shown_ = 0, recorded_ = 0;
};

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
  EXPECT_EQ(metrics.counts.at("device opened again"), 2u);
  EXPECT_NE(out.str().find("ErrorDeviceLost"), std::string::npos) << out.str();

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

}  // namespace rig_device_lost_test
}  // namespace previz::rig

// The layer must be known before the first instance is made.
int main(int argc, char** argv) {
  setenv("VK_LAYER_PATH", PREVIZ_LAYERS, 1);
  setenv("VK_INSTANCE_LAYERS", "VK_LAYER_PREVIZ_lose_device", 1);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
