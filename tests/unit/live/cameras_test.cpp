// From what a set says to the rig's cameras.
#include "daemon/core/live/cameras.hpp"

#include <nlohmann/json.hpp>

#include "daemon/core/live/camera_source.hpp"
#include "drivers/camera_drivers.hpp"
#include "tests/support/other_camera.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::live::cameras_test {

using std::chrono::milliseconds;

class RigCameras : public testing::Test {
 protected:
  void SetUp() override { session::write_small_session(take(), 30); }
  std::filesystem::path take() const { return directory_.path() / "take"; }

  set::Set replayed() const {
    set::Set set;
    set.file = "stage.toml";
    set.observer.device = take().string();
    set.light_camera.driver = set::no_driver;
    return set;
  }

  static std::string error_of(const set::Set& set) {
    return test::error_of([&] { open_cameras(set); });
  }

  test::TemporaryDirectory directory_;
  std::ostringstream out_;
  report::Reports reports_{report::lines_to(out_)};
  pipeline::Metrics metrics_;
  pipeline::Liveness liveness_;
};

// The light's three frames last 3 ms, the film camera's eight 320: each lap is as long as the
// longer.
TEST_F(RigCameras, LoopedStreamsOfASessionStayTogether) {
  test::write_small_take(directory_.path());
  set::Set set = replayed();
  set.observer.device = (directory_.path() / "session").string();
  set.light_camera.driver = set::replay_driver;
  const Cameras cameras = open_cameras(set, /*loop=*/true);
  EXPECT_EQ(cameras.light_exposures, 3u);
  EXPECT_EQ(cameras.lap_ns, 8 * test::small_take_interval_ns);
  std::vector<FramePtr> frames;
  while (frames.size() < 4) {
    CameraEvent event = cameras.light->next(milliseconds(10'000));
    ASSERT_TRUE(std::holds_alternative<FramePtr>(event));
    frames.push_back(std::get<FramePtr>(event));
  }
  EXPECT_EQ(frames[3]->timestamp_ns, frames[0]->timestamp_ns + cameras.lap_ns);
}

TEST_F(RigCameras, MistakesNameFileAndKey) {
  set::Set set = replayed();
  set.observer.faults = {"melt@3"};
  EXPECT_THAT(error_of(set), HasSubstr("stage.toml: observer.faults: fault \"melt@3\""));
  set = replayed();
  set.observer.driver = "gopro";  // one that this build lacks
  EXPECT_THAT(error_of(set), HasSubstr("stage.toml: observer.driver: this build supports no"));
  set = replayed();
  set.light_camera.driver = set::replay_driver;
  EXPECT_THAT(error_of(set), HasSubstr("the session has no light frames"));
}

// A rig starts with everything absent and picks its cameras up as they come.
TEST_F(RigCameras, ACameraThatIsNotThereIsWaitedFor) {
  if (camera_drivers().empty()) GTEST_SKIP() << "this build has no driver for a real camera";
  set::Set set = replayed();
  set.observer.driver = camera_drivers().front().name;
  set.observer.device = "missing";
  const Cameras cameras = open_cameras(set);
  const CameraEvent event = cameras.observer->next(milliseconds(0));
  ASSERT_TRUE(std::holds_alternative<DeviceTrouble>(event));
  EXPECT_THAT(std::get<DeviceTrouble>(event).what, HasSubstr("retrying until it is available"));
  EXPECT_EQ(cameras.observer->counters().at("not opened"), 1u);
}

// Silence is what counts: whether a camera says nothing, or throws.
TEST_F(RigCameras, ACameraThatThrowsAtEveryCallIsLost) {
  Cameras cameras = open_cameras(replayed(), /*loop=*/true);
  bool throws = false;
  test::put_around(cameras.observer, [&](CameraEvent event, Camera&) -> CameraEvent {
    if (throws) throw Error("lamp fell down");
    return event;
  });
  std::stop_source stop;
  bool is_lost = false;
  CameraSource source(*cameras.observer, "observer", "film camera",
                      {stop.get_token(), {reports_, metrics_, liveness_}, 0.3, [&](bool lost) {
                         is_lost = lost;
                         stop.request_stop();
                       }});
  ASSERT_TRUE(source.next());
  throws = true;
  std::jthread limit([&](const std::stop_token& is_over) {
    const auto has_ended = [&] { return is_over.stop_requested(); };
    if (!test::wait_until("it has ended", has_ended, std::chrono::seconds(30))) stop.request_stop();
  });
  EXPECT_FALSE(source.next());
  EXPECT_TRUE(is_lost);
}

TEST_F(RigCameras, EachLossOfADeviceIsALineWithItsNumber) {
  set::Set set = replayed();
  set.observer.faults = {"disconnect@2+0s"};
  std::string cameras_name;
  for (int loaded = 1; loaded <= 3; ++loaded) {
    const Cameras cameras = open_cameras(set, /*loop=*/true);
    cameras_name = cameras.observer->name();
    CameraSource source(*cameras.observer, "observer", "film camera",
                        {{}, {reports_, metrics_, liveness_}, 1.0, {}});
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(source.next());
  }
  const std::string lost = cameras_name + ": was unplugged; reopening it";
  EXPECT_EQ(out_.str(), lost + "\n" + lost + ", the 2nd time in this run\n" + lost +
                            ", the 3rd time in this run\n");
}

// `previzctl metrics` prints them; they go on over sets that are loaded anew.
TEST_F(RigCameras, WhatADeviceCountsIsInTheMetrics) {
  set::Set set = replayed();
  set.observer.faults = {"disconnect@2+0s"};
  for (int loaded = 1; loaded <= 2; ++loaded) {
    const Cameras cameras = open_cameras(set, /*loop=*/true);
    CameraSource source(*cameras.observer, "observer", "film camera",
                        {{}, {reports_, metrics_, liveness_}, 1.0, {}});
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(source.next());
    const pipeline::MetricsSnapshot snapshot = metrics_.snapshot(1);
    const DeviceCounters& counted = snapshot.devices.at("observer");
    EXPECT_EQ(counted.at("opened"), 2u * loaded);
    EXPECT_EQ(counted.at("lost"), 1u * loaded);
    EXPECT_EQ(counted.at("returned"), 1u * loaded);
    EXPECT_EQ(counted.at("stalled"), 0u);  // there before anything is counted
  }
  const auto json = nlohmann::json::parse(to_json(metrics_.snapshot(1)));
  EXPECT_EQ(json["devices"]["observer"]["lost"], 2);
}

}  // namespace previz::live::cameras_test
