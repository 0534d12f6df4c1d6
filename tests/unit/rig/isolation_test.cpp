// What fails beside the recorder ends neither the rig nor a take.
#include <fcntl.h>
#include <sys/stat.h>
#include <systemd/sd-bus.h>

#include "daemon/control/bus.hpp"
#include "daemon/core/session/draft.hpp"
#include "drivers/descriptor.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/other_camera.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::isolation_test {

using test::RigLive;
using test::unbroken;

class RigIsolation : public RigLive, public testing::WithParamInterface<const char*> {};

// Every stage in turn throws in the middle of a take: once, and once more when it begins anew.
TEST_P(RigIsolation, AStageThatFailsBeginsAnewAndTheTakeLacksNothing) {
  const std::string stage = GetParam();
  write_set("composite = true\n[display]\ndriver = \"headless\"\nmode = \"480x270\"\n");
  std::atomic<int> failures = 0;
  options_.rehearse = [&](const std::string& part) {
    if (part == stage && failures > 0 && failures-- > 0) throw std::runtime_error("lamp fell down");
  };
  run_rendering([&] {
    press("record");
    until([](const Shown& s) { return s.records(2); });
    for (int times = 1; times <= 2; ++times) {
      failures = 2;
      test::must_come(
          stage + " works again", [&] { return count_said(stage + ": works again") == times; },
          [&] { return log_.text(); });
    }
    const int before = shown_now().count;
    until([&](const Shown& s) { return s.count > before + 4 && s.shot.samples == 2; });
    end_take();
  });
  EXPECT_EQ(count_said(stage + ": has failed and is restarting; recording continues: lamp fell"),
            2)  // what is thrown twice in a row is reported once
      << log_.text();
  EXPECT_EQ(metrics_.counts.at(stage + ": failed"), 4u);
  EXPECT_EQ(metrics_.counts.at(stage + ": restarted"), 2u);
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);

  const std::vector<session::FrameRecord> frames = unbroken(take_folder());
  ASSERT_GT(frames.size(), 20u);
  EXPECT_GT(frames.back().timestamp_ns - frames.front().timestamp_ns, 1'000'000'000);
  EXPECT_GT(session::open_session(take_folder()).track.size(), 8u);
}

INSTANTIATE_TEST_SUITE_P(Stages, RigIsolation,
                         testing::Values("conversion", "tracking", "lighting", "picture lighting",
                                         "render", "display", "composite recording", "screen"),
                         [](const auto& name) {
                           std::string word = name.param;
                           std::erase(word, ' ');
                           return word;
                         });

// While the renderer is made anew, the plate is shown: in the preview, and in a refinement, in
// which tracking rests.
TEST_F(RigLive, TheCrewSeesThePlateWhileTheRendererIsMadeAnew) {
  write_set();
  std::atomic<bool> fails = false;
  options_.rehearse = [&](const std::string& part) {
    if (part == "render" && fails) throw std::runtime_error("lamp fell down");
  };
  const auto until_plates = [&](live::Mode mode, int pictures) {
    const auto is_plate = [mode](const Shown& s) {
      return s.shot.untouched == "the renderer has failed" && s.look.state.mode == mode;
    };
    fails = true;
    const int first = until(is_plate).count;
    until([&](const Shown& s) { return s.count > first + pictures && is_plate(s); });
    fails = false;
  };
  run_rendering([&] {
    until_plates(live::Mode::live, 4);
    until_samples(2);
    press("refine");
    until_mode(live::Mode::refine);
    until_counted("frames not tracked in this mode");
    until_plates(live::Mode::refine, 8);
    until_frozen();
  });
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
}

// A camera is unplugged and another one of another size is plugged in, while the preview has half
// the camera's size. The take ends with the one and the next begins with the other.
TEST_F(RigLive, ACameraOfAnotherSizeBeginsTheNextTakeAndIsShownAsItIs) {
  write_set();
  replace_in_set("samples = 2", "samples = 2\nscale = 0.5");
  std::atomic<bool> is_other = false;
  options_.around_cameras = [&](live::Cameras& cameras) {
    test::put_around(
        cameras.observer,
        [&, was_other = false](CameraEvent event, Camera& camera) mutable -> CameraEvent {
          const auto* captured = std::get_if<FramePtr>(&event);
          if (!captured || !is_other) return event;
          if (!std::exchange(was_other, true))
            return DeviceTrouble{camera.name(), "was unplugged", true};
          auto frame = std::make_shared<Frame>(**captured);
          frame->width = 64;
          frame->height = 48;
          frame->bytes.assign(frame_bytes(frame->format, 64, 48), 100);
          return FramePtr(std::move(frame));
        });
  };
  run([&] {
    until([](const Shown& s) { return s.shot.samples == 2 && s.shot.picture->width == 48; });
    begin_take();
    until_more(4);
    is_other = true;
    const int other = until([](const Shown& s) { return s.shot.picture->width == 64; }).count;
    const Shown shown =
        until([&](const Shown& s) { return s.count > other + 4 && s.shot.picture->width == 64; });
    EXPECT_EQ(shown.shot.untouched,
              "observer: a frame of 64x48 does not fit the calibration's 48x36");
    is_other = false;  // and back
    until([](const Shown& s) { return s.shot.samples == 2 && s.shot.picture->width == 48; });
    end_take("12A_take003");
  });
  for (const auto& [name, width] :
       {std::pair("12A_take001", 48), {"12A_take002", 64}, {"12A_take003", 48}}) {
    session::Session session = session::open_session(take_folder(name));
    EXPECT_TRUE(session.missing.empty()) << testing::PrintToString(session.missing);
    EXPECT_EQ(session::open_stream(session, "observer")->width(), width);
  }
}

// A driver that throws where none may.
TEST_F(RigLive, ACameraThatThrowsIsAskedAgain) {
  write_set();
  std::atomic<bool> throws = false;
  options_.around_cameras = [&](live::Cameras& cameras) {
    test::put_around(cameras.light, [&](CameraEvent event, Camera&) -> CameraEvent {
      if (throws.exchange(false)) throw std::runtime_error("lamp fell down");
      return event;
    });
  };
  run_rendering([&] {
    begin_take();
    throws = true;
    until_said("has failed: lamp fell down; trying again");
    until_more(8);
    end_take();
  });
  unbroken(take_folder());
}

// A camera whose shutter time cannot be set, and whose driver throws rather than say so.
class StubbornCamera final : public test::OtherCamera {
 public:
  explicit StubbornCamera(std::unique_ptr<Camera> camera)
      : OtherCamera(std::move(camera), [](CameraEvent event, Camera&) -> CameraEvent {
          const auto* captured = std::get_if<FramePtr>(&event);
          if (!captured) return event;
          auto frame = std::make_shared<Frame>(**captured);
          frame->exposure_s = 0.01;
          return FramePtr(std::move(frame));
        }) {}
  bool set_exposure(double, double) override { throw std::runtime_error("lamp fell down"); }
};

TEST_F(RigLive, ACameraThatThrowsWhereItsExposureIsSetIsAskedOnce) {
  write_set();
  options_.around_cameras = [&](live::Cameras& cameras) {
    cameras.observer = std::make_unique<StubbornCamera>(std::move(cameras.observer));
  };
  run_rendering([&] {
    begin_take();
    press("exposure_up");
    until_said("its exposure cannot be set: lamp fell down");
    until_more(8);
    end_take();
  });
  EXPECT_EQ(metrics_.counts.at("observer: device trouble"), 1u);
  unbroken(take_folder());
}

// What no keeper catches ends the rig, but not the recording: the next process records on.
TEST_F(RigLive, AStageThatEndsTheRigDoesNotEndTheRecording) {
  write_set();
  std::atomic<bool> throws = false;
  options_.around_cameras = [&](live::Cameras& cameras) {
    test::put_around(cameras.observer, [&](CameraEvent event, Camera&) -> CameraEvent {
      if (throws) throw 7;  // no error, as C++ libraries throw them
      return event;
    });
  };
  const std::filesystem::path takes = directory_ / "takes";
  const auto script = [&] {
    until_samples(2);
    begin_take();
    until_more(8);
    throws = true;
    test::must_come("the take is closed", [&] {
      const std::string text = test::content_of(takes / "12A_take001/session.toml");
      return text.find("closed = true") != std::string::npos;
    });
  };
  EXPECT_THROW(run(script), int);
  EXPECT_GT(unbroken(takes / "12A_take001").size(), 4u);
  EXPECT_TRUE(std::filesystem::exists(takes / ".recording"));
}

// Returns why a call to the rig on the bus failed, "" if it did not.
template <class... Arguments>
std::string call(const char* method, const char* types, Arguments... arguments) {
  sd_bus* client = nullptr;
  sd_bus_error error = SD_BUS_ERROR_NULL;
  std::string refused = "no bus";
  if (sd_bus_open_system(&client) >= 0) {
    const int result =
        sd_bus_call_method(client, control::bus_name, control::object_path, control::interface_name,
                           method, &error, nullptr, types, arguments...);
    refused = result >= 0 ? "" : error.message ? error.message : "no answer";
  }
  sd_bus_error_free(&error);
  sd_bus_flush_close_unref(client);
  return refused;
}

bool rig_answers() {
  return call("Metrics", "").empty();
}

// Where the set says so, whoever is on the bus may begin a take and not end one; a button may.
TEST_F(RigLive, OnlyAButtonEndsATakeWhereTheSetSaysSo) {
  const test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  write_set("end_over_bus = false\n");
  options_.bus = true;
  run([&] {
    test::must_come("the rig answers", rig_answers);
    EXPECT_EQ(call("Record", "b", 1), "");
    until([](const Shown& s) { return s.look.state.recording; });
    const std::string refusal = "the set lets only buttons end a take (recording.end_over_bus)";
    EXPECT_EQ(call("Record", "b", 0), refusal);
    EXPECT_EQ(call("Action", "s", "record"), refusal);
    EXPECT_EQ(call("Record", "b", 1), "");
    EXPECT_TRUE(shown_now().look.state.recording);
    end_take();
    EXPECT_EQ(call("Action", "s", "record"), "");
    until([](const Shown& s) { return s.look.state.recording; });
  });
}

// The message bus is restarted, as by an upgrade of the system: the rig is on it again.
TEST_F(RigLive, ABusThatIsRestartedIsJoinedAgain) {
  test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  write_set();
  options_.bus = true;
  run([&] {
    test::must_come("the rig answers", rig_answers);
    begin_take();
    bus.stop();
    until_said("bus: has failed and is restarting");
    bus.start();
    test::must_come("the rig answers again", rig_answers);
    end_take();
  });
  unbroken(take_folder());
}

// Hangs until somebody lets it go, or the test has waited in vain.
class Gate {
 public:
  void wait() const { opened_.wait_for(2 * test::longest_wait); }
  void open() { open_.set_value(); }

 private:
  std::promise<void> open_;
  std::shared_future<void> opened_ = open_.get_future().share();
};

// A camera that takes days to be given back, or whose driver does not return.
class HangingCamera final : public test::OtherCamera {
 public:
  HangingCamera(std::unique_ptr<Camera> camera, const Gate& gate, Change change)
      : OtherCamera(std::move(camera), std::move(change)), gate_(gate) {}
  ~HangingCamera() override { gate_.wait(); }

 private:
  const Gate& gate_;
};

class RigStop : public RigLive, public testing::WithParamInterface<bool> {};

// A stop in the middle of a take: the take is closed before any device is given back.
TEST_P(RigStop, ClosesTheTakeBeforeADeviceThatHangs) {
  const bool hangs_in_next = GetParam();
  write_set();
  Gate gate;
  std::atomic<bool> is_over = false;
  options_.around_cameras = [&](live::Cameras& cameras) {
    cameras.observer = std::make_unique<HangingCamera>(std::move(cameras.observer), gate,
                                                       [&](CameraEvent event, Camera&) {
                                                         if (is_over && hangs_in_next) gate.wait();
                                                         return event;
                                                       });
  };
  const std::filesystem::path take = take_folder();
  std::jthread witness([&] {
    const auto is_closed = [&] {
      const std::filesystem::path file = take / "session.toml";
      return is_over && std::filesystem::exists(file) &&
             test::content_of(file).find("closed = true") != std::string::npos;
    };
    EXPECT_TRUE(test::wait_until("the take is closed", is_closed));
    gate.open();
  });
  run([&] {
    begin_take();
    until_more(8);
    is_over = true;
  });
  EXPECT_GT(unbroken(take).size(), 4u);
}

INSTANTIATE_TEST_SUITE_P(InItsDestructorOrInNext, RigStop, testing::Bool());

// Reviews that are begun and ended faster than a take is read.
TEST_F(RigLive, ReviewsThatAreToggledFollowEachOther) {
  write_set();
  run_rendering([&] {
    begin_take();
    until_more(8);
    end_take();
    for (int times = 0; times < 10; ++times) press(times % 2 == 0 ? "review" : "live");
    press("review");
    until([](const Shown& s) {
      return s.look.state.mode == live::Mode::review && s.shot.samples == 2;
    });
  });
  EXPECT_THAT(log_.text(), Not(HasSubstr("reading interrupted")));
}

}  // namespace previz::rig::isolation_test
