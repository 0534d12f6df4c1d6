// What the USB itself can do for a device, on one that is really there: PREVIZ_TEST_USB_CABLE names
// the file that stands for a USB camera's cable (tests/rig_vm).
#include "drivers/usb/usb.hpp"
#include "drivers/camera_drivers.hpp"
#include "drivers/lifeline.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test::usb_test {

using std::chrono::milliseconds;

constexpr std::chrono::seconds patience{30};

class UsbCamera : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const char* cable = std::getenv("PREVIZ_TEST_USB_CABLE");
    if (!cable) GTEST_SKIP() << "there is no USB camera to be wedged and unplugged (tests/rig_vm)";
    cable_ = cable;
    for (const FoundCamera& camera : driver_.find())
      if (driver_.usb_place(camera.device)) name_ = camera.device;
    ASSERT_FALSE(name_.empty()) << "the USB camera is not found";
  }

  // As the next test wants it, whatever this one did.
  void TearDown() override {
    if (cable_.empty()) return;
    std::filesystem::remove(wedge());
    std::ofstream(cable_).close();
  }

  std::unique_ptr<Camera> open() const {
    CameraSettings settings;
    settings.device = name_;
    return driver_.open(settings);
  }

  std::filesystem::path wedge() const { return cable_.string() + ".wedged"; }

  const CameraDriver& driver_ = camera_driver(GetParam());
  std::filesystem::path cable_;
  std::string name_;
};

// Returns the trouble that is reported before a frame comes.
std::vector<std::string> trouble_until_a_frame(Lifeline& lifeline, const auto& may_come) {
  std::vector<std::string> reports;
  const auto end = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < end) {
    const CameraEvent event = lifeline.next(milliseconds(50));
    if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) reports.push_back(trouble->what);
    if (std::holds_alternative<FramePtr>(event) && may_come()) return reports;
  }
  ADD_FAILURE() << "no frame came; reported was " << testing::PrintToString(reports);
  return reports;
}

// The wedge is gone when the device was reset: nothing else takes it away while it is plugged in.
TEST_P(UsbCamera, ThatIsWedgedIsResetAndSendsAgain) {
  LifelineHooks hooks;
  hooks.reset = [this]() -> std::optional<std::string> {
    const std::optional<usb::Place> place = driver_.usb_place(name_);
    return place ? std::optional(usb::reset(*place)) : std::nullopt;
  };
  const LifelineOptions options{milliseconds(5000), milliseconds(2000), milliseconds(100), {}};
  Lifeline lifeline(
      "film camera", [this] { return open(); }, options, HostClock{}, hooks);
  lifeline.start();
  trouble_until_a_frame(lifeline, [] { return true; });
  std::ofstream(wedge()).close();
  const std::vector<std::string> reports =
      trouble_until_a_frame(lifeline, [this] { return !exists(wedge()); });
  EXPECT_THAT(reports, Contains(HasSubstr("it was reset")));
  EXPECT_GE(lifeline.counters().at("reset"), 1u);
}

TEST_P(UsbCamera, ThatIsPluggedInIsTold) {
  const usb::Hotplug hotplug;
  std::filesystem::remove(cable_);
  EXPECT_TRUE(wait_until(
      "the camera is gone", [this] { return !driver_.usb_place(name_); }, patience));
  const std::uint64_t before = hotplug.arrivals();
  std::ofstream(cable_).close();
  EXPECT_TRUE(wait_until(
      "an arrival is reported", [&] { return hotplug.arrivals() > before; }, patience));
  EXPECT_TRUE(wait_until(
      "the camera is found",
      [this] { return std::ranges::count(driver_.find(), name_, &FoundCamera::device) == 1; },
      patience));
}

std::vector<std::string> drivers_of_usb_cameras() {
  std::vector<std::string> names;
  for (const CameraDriver& driver : camera_drivers())
    if (const std::string name = driver.name; name == "v4l2" || name == "libcamera")
      names.push_back(name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Drivers, UsbCamera, testing::ValuesIn(drivers_of_usb_cameras()),
                         [](const auto& instance) { return instance.param; });

}  // namespace previz::test::usb_test
