// Cameras that are really there: those PREVIZ_TEST_V4L2 and PREVIZ_TEST_LIBCAMERA name (as a set
// would), or the first that their drivers find. The kernel's vivid does for V4L2 (modprobe vivid).
#include <array>
#include <cstdlib>
#include <optional>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/devices.hpp"
#include "tests/devices/kernel_cable.hpp"

namespace previz::test {
namespace {

class KernelDevice final : public DeviceUnderTest {
 public:
  KernelDevice(const char* driver, std::string name)
      : driver_(driver), name_(std::move(name)), cable_(driver, name_) {
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

  const char* driver_;
  const std::string name_;
  KernelCable cable_;
  bool drives_exposure_ = false;
};

std::unique_ptr<DeviceUnderTest> make(const char* driver, const char* variable) {
  if (const char* name = std::getenv(variable)) return std::make_unique<KernelDevice>(driver, name);
  const std::vector<FoundCamera> found = camera_driver(driver).find();
  return found.empty() ? nullptr : std::make_unique<KernelDevice>(driver, found.front().device);
}

}  // namespace

std::unique_ptr<DeviceUnderTest> make_v4l2(std::string& why_not) {
  why_not = "this machine has no V4L2 camera (vivid would do: modprobe vivid)";
  return make("v4l2", "PREVIZ_TEST_V4L2");
}

std::unique_ptr<DeviceUnderTest> make_libcamera(std::string& why_not) {
  why_not = "this machine has no camera that libcamera knows";
  return make("libcamera", "PREVIZ_TEST_LIBCAMERA");
}

}  // namespace previz::test
