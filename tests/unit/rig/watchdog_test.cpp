// What systemd hears of the rig: its watchdog is fed by threads that are live, not by frames.
#include "daemon/rig/service.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/notify_socket.hpp"
#include "tests/support/other_camera.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::watchdog_test {

using test::NotifySocket;
using test::RigLive;

// The watchdog is fed every 50 ms here. A machine that is busy with other tests is late at times,
// so that a quarter of it is enough.
constexpr std::chrono::milliseconds while_fed{2000};
constexpr int often = 10;

// A display that hangs: the camera goes on, and the watchdog starves although the loop is alive.
TEST_F(RigLive, TheWatchdogStarvesWhileAThreadHangs) {
  write_set();
  NotifySocket systemd(directory_ / "notify");
  options_.patience.stage = std::chrono::milliseconds(1000);
  std::mutex gate;
  while_shown_ = [&] { const std::lock_guard wait(gate); };
  run([&] {
    systemd.until("READY=1");
    systemd.until("WATCHDOG=1");
    {
      const std::lock_guard hang(gate);
      until_said("stopped responding: display");
      systemd.skip();
      press("samples_up");  // the loop answers
      systemd.until("STATUS=button samples_up");
      EXPECT_EQ(systemd.fed_within(std::chrono::milliseconds(500)), 0);
    }
    systemd.until("WATCHDOG=1");
  });
  systemd.until("STOPPING=1");
}

// A legal set may wait for its camera for ten minutes before it counts as lost; here it does for
// two seconds.
TEST_F(RigLive, TheWatchdogIsFedWhileTheCameraIsSilent) {
  write_set();
  NotifySocket systemd(directory_ / "notify");
  std::atomic<bool> is_silent = false;
  options_.around_cameras = [&](live::Cameras& cameras) {
    test::put_around(cameras.observer, [&](CameraEvent event, Camera&) -> CameraEvent {
      if (!is_silent) return event;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return NoFrame{};
    });
  };
  run_rendering([&] {
    is_silent = true;
    systemd.skip();
    EXPECT_GE(systemd.fed_within(while_fed), often);
    is_silent = false;
    until_more(0);
  });
}

class ServiceTest : public testing::Test {
 protected:
  void expect_silence() {
    systemd_.skip();
    EXPECT_EQ(systemd_.next(300), "");
  }

  const test::TemporaryDirectory directory_;
  NotifySocket systemd_{directory_ / "notify"};
  std::ostringstream log_;
  report::Reports reports_{report::lines_to(log_)};
  pipeline::Liveness liveness_;
};

// systemd waits 90 s for a start unless it is asked for more.
TEST_F(ServiceTest, AsksForMoreTimeUntilItIsReadyAndWhileItStops) {
  pipeline::Liveness::Pulse pulse(liveness_, "main loop");
  pulse.begin(std::chrono::hours(1));
  Service service(liveness_, reports_, {});
  for (int times = 0; times < 3; ++times) systemd_.until("EXTEND_TIMEOUT_USEC=");
  service.ready("set \"desk\"");
  systemd_.until("READY=1");
  systemd_.until("WATCHDOG=1");
  service.stopping();
  systemd_.until("STOPPING=1");
  for (int times = 0; times < 3; ++times) systemd_.until("EXTEND_TIMEOUT_USEC=");
  pulse.begin(std::chrono::milliseconds(-1));  // it hangs
  test::must_come("the hang is reported",
                  [&] { return log_.str() == "stopped responding: main loop\n"; });
  expect_silence();
}

// A camera that hangs takes no time from the disk that takes what is queued.
TEST_F(ServiceTest, WhileATakeIsClosedTheMainThreadAloneDecides) {
  pipeline::Liveness::Pulse main(liveness_, Service::main_thread), camera(liveness_, "observer");
  main.begin(std::chrono::hours(1));
  camera.begin(std::chrono::milliseconds(-1));  // it hangs
  Service service(liveness_, reports_, {});
  service.ready("set \"desk\"");
  systemd_.until("READY=1");
  expect_silence();
  service.closing_take(true);  // another set was read
  systemd_.until("WATCHDOG=1");
  service.stopping();
  for (int times = 0; times < 3; ++times) systemd_.until("EXTEND_TIMEOUT_USEC=");
  service.closing_take(false);
  systemd_.next(100);
  expect_silence();
  service.closing_take(true);
  systemd_.until("EXTEND_TIMEOUT_USEC=");
  main.begin(std::chrono::milliseconds(-1));  // it does not wait for the disk any more
  systemd_.next(100);
  expect_silence();
}

// A start may be granted ten minutes, but none of them once it is to stop.
TEST_F(ServiceTest, AsksForNoTimeToStartWhatIsToStop) {
  std::stop_source stop;
  Service service(liveness_, reports_, stop.get_token());
  systemd_.until("EXTEND_TIMEOUT_USEC=");
  stop.request_stop();
  systemd_.next(100);
  expect_silence();
  service.stopping();
  systemd_.until("STOPPING=1");
  systemd_.until("EXTEND_TIMEOUT_USEC=");
}

// A camera whose giving back comes at the same time as a stop.
class StoppingCamera final : public test::OtherCamera {
 public:
  StoppingCamera(std::unique_ptr<Camera> camera, std::stop_source& stop)
      : OtherCamera(std::move(camera), [](CameraEvent event, Camera&) { return event; }),
        stop_(stop) {}
  ~StoppingCamera() override { stop_.request_stop(); }

 private:
  std::stop_source& stop_;
};

TEST_F(RigLive, AStopThatComesWithASetThatWasReadOpensNoDevicesForIt) {
  write_set();
  NotifySocket systemd(directory_ / "notify");
  std::stop_source stop;
  int opened = 0;
  options_.loop = true;
  options_.around_cameras = [&](live::Cameras& cameras) {
    ++opened;
    cameras.observer = std::make_unique<StoppingCamera>(std::move(cameras.observer), stop);
  };
  press("reload_set");
  std::ostream out(&log_);
  report::Reports reports(report::lines_to(out));
  run_live(test::with_hand(options_, directory_.path(), hand_, stop), reports);
  EXPECT_EQ(opened, 1) << log_.text();
  systemd.until("STOPPING=1");
}

}  // namespace previz::rig::watchdog_test
