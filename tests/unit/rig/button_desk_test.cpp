// The desk of buttons with a device of the test's own, without a rig.
#include "daemon/rig/button_desk.hpp"

#include "tests/support/hand.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::button_desk_test {

// Reports one trouble, and that it is lost.
class BrokenPad final : public Buttons {
 public:
  std::string name() const override { return "pad"; }
  int fd() const override { return descriptor_.get(); }
  std::optional<ButtonsEvent> next() override {
    if (said_) return std::nullopt;
    said_ = true;
    return DeviceTrouble{"/dev/hidraw7", "was unplugged", true};
  }
  DeviceCounters counters() const override { return {{"lost", 1}}; }

 private:
  bool said_ = false;
  OwnedDescriptor descriptor_{eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK)};
};

// A button that is pushed and released without end.
class BabblingPad final : public Buttons {
 public:
  std::string name() const override { return "wet"; }
  int fd() const override { return descriptor_.get(); }
  std::optional<ButtonsEvent> next() override {
    pressed_ = !pressed_;
    return ButtonEvent{"red", pressed_, ++taken_};
  }
  DeviceCounters counters() const override { return {}; }

 private:
  bool pressed_ = false;
  std::int64_t taken_ = 0;
  OwnedDescriptor descriptor_{eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK)};
};

class ButtonDeskTest : public testing::Test {
 protected:
  // Reads what waits now; the timer ends the loop.
  void run(std::vector<ButtonDesk::Device> devices) {
    const std::vector<set::Button> mapped = {{"red", set::PressKind::short_press, "record"},
                                             {"blue", set::PressKind::short_press, "refine"}};
    ButtonDesk::Asks asks;
    asks.listens = [this] { return listens_; };
    asks.edge = [this](const ButtonEvent& event) {
      said_ << event.button << (event.pressed ? " down" : " up") << " at " << event.timestamp_ns
            << "\n";
      return event.pressed && refining_;
    };
    asks.act = [this](const set::Action& action, const std::string& button, bool ended) {
      said_ << button << ": " << action.name << (ended ? ", which ended a refinement" : "") << "\n";
    };
    EventLoop loop;
    ButtonDesk desk(mapped, std::move(devices), {loop, reports_, metrics_}, asks);
    const auto ticks = loop.every(std::chrono::milliseconds(1), [&] { ++ticks_; });
    const auto timer = loop.every(std::chrono::milliseconds(50), [&] { loop.exit(); });
    loop.run();
    desk.count();
  }
  void run(std::unique_ptr<Buttons> buttons, std::int64_t clock_offset_ns = 0) {
    std::vector<ButtonDesk::Device> devices;
    devices.push_back({std::move(buttons), clock_offset_ns});
    run(std::move(devices));
  }
  void run_hand(std::int64_t clock_offset_ns = 0) {
    run(std::make_unique<test::Hand::Device>(hand_), clock_offset_ns);
  }

  std::ostringstream log_, said_;
  report::Reports reports_{report::lines_to(log_)};
  pipeline::Metrics metrics_;
  test::Hand hand_;
  bool listens_ = true, refining_ = false;
  int ticks_ = 0;
};

TEST_F(ButtonDeskTest, AsksForTheActionOfAPressInTheCamerasClock) {
  hand_.press("red");
  hand_.press("unknown");
  run_hand(5);
  EXPECT_EQ(said_.str(),
            "red down at 5\nred: record\nred up at 5\nunknown down at 5\n"
            "unknown up at 5\n");
}

TEST_F(ButtonDeskTest, APressThatEndedARefinementAsksForNoModeAndSaysSo) {
  refining_ = true;
  hand_.press("blue");
  hand_.press("red");
  run_hand();
  EXPECT_EQ(said_.str(),
            "blue down at 0\nblue up at 0\n"
            "red down at 0\nred: record, which ended a refinement\nred up at 0\n");
}

TEST_F(ButtonDeskTest, LeavesEventsToTheNextDeskWhereItDoesNotListen) {
  listens_ = false;
  hand_.press("red");
  run_hand();
  EXPECT_EQ(said_.str(), "");
  listens_ = true;
  run_hand();
  EXPECT_EQ(said_.str(), "red down at 0\nred: record\nred up at 0\n");
}

TEST_F(ButtonDeskTest, ALostDeviceIsReportedAndReadNoMore) {
  run(std::make_unique<BrokenPad>());  // its descriptor stays readable, and must not be read again
  EXPECT_EQ(log_.str(), "/dev/hidraw7: was unplugged\n");
  ASSERT_EQ(reports_.troubles().size(), 1u);
  EXPECT_EQ(reports_.troubles()[0], report::lasting("pad", "was unplugged"));
  EXPECT_EQ(metrics_.snapshot(1).devices.at("pad").at("lost"), 1u);
}

// The loop's timers go on. (Without an end to a turn, this test would never end.)
TEST_F(ButtonDeskTest, ADeviceThatAlwaysHasAnotherEventDoesNotStopTheLoop) {
  run(std::make_unique<BabblingPad>());
  EXPECT_GT(ticks_, 1);
  const DeviceCounters counted = metrics_.snapshot(1).devices.at("wet");
  EXPECT_GT(counted.at("event bursts larger than one read"), 1u);
}

TEST_F(ButtonDeskTest, MoreEventsThanOneTurnReadsAllCome) {
  for (int i = 0; i < 3 * ButtonDesk::most_events_a_turn; ++i) hand_.press("red");
  run_hand();
  std::string expected;
  for (int i = 0; i < 3 * ButtonDesk::most_events_a_turn; ++i)
    expected += "red down at 0\nred: record\nred up at 0\n";
  EXPECT_EQ(said_.str(), expected);
}

}  // namespace previz::rig::button_desk_test
