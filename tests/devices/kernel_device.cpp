// Cameras that are really there: those that PREVIZ_TEST_V4L2 and the like name (as a set would), or
// the first that their drivers find. The kernel's vivid does for V4L2 (modprobe vivid).
#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <optional>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/devices.hpp"
#include "tests/devices/kernel_cable.hpp"

namespace previz::test {
namespace {

class KernelDevice final : public DeviceUnderTest {
 public:
  KernelDevice(std::string driver, std::string name)
      : driver_(std::move(driver)), name_(std::move(name)), cable_(driver_, name_) {
    drives_exposure_ = open()->set_exposure(some_exposures[0].exposure_s, 1);
  }

  std::unique_ptr<Camera> open() override { return open(name_); }
  std::unique_ptr<Camera> open_missing() override { return open("missing"); }

  void unplug() override { cable_.unplug(); }
  void plug() override { cable_.plug(); }
  std::string why_no_cable() const override { return cable_.why_not(); }
  std::chrono::milliseconds stall_timeout() const override { return std::chrono::seconds(5); }

  bool may_lose_frames() const override { return true; }  // under load the kernel drops
  // A stated bound: libcamera and udev make what they need anew for each device that comes.
  std::size_t kept_by_others() const override { return 1024; }
  std::span<const Exposure> exposures() const override {
    if (!drives_exposure_) return {};
    return some_exposures;
  }

 private:
  // In steps of UVC's unit, 100 us.
  static constexpr std::array<Exposure, 3> some_exposures{{{0.005, 1}, {0.01, 1}, {0.02, 1}}};

  std::unique_ptr<Camera> open(const std::string& name) const {
    CameraSettings settings;
    settings.device = name;
    if (drives_exposure_) settings.exposure_s = some_exposures[0].exposure_s;
    return camera_driver(driver_).open(settings);
  }

  const std::string driver_;
  const std::string name_;
  KernelCable cable_;
  bool drives_exposure_ = false;
};

}  // namespace

std::unique_ptr<DeviceUnderTest> make_found(const std::string& driver, std::string& why_not) {
  why_not = "this machine has no camera of the driver " + driver +
            (driver == "v4l2" ? " (vivid would do: modprobe vivid)" : "");
  std::string variable = "PREVIZ_TEST_" + driver;
  std::ranges::transform(variable, variable.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  if (const char* name = std::getenv(variable.c_str()))
    return std::make_unique<KernelDevice>(driver, name);
  const std::vector<FoundCamera> found = camera_driver(driver).find();
  return found.empty() ? nullptr : std::make_unique<KernelDevice>(driver, found.front().device);
}

}  // namespace previz::test
