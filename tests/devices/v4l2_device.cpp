// A V4L2 camera that is really there: the one PREVIZ_TEST_V4L2 names (as a set would), or the
// first that udev knows. The kernel's vivid does (modprobe vivid).
#include <cstdlib>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/devices.hpp"

namespace previz::test {
namespace {

class V4l2Device final : public DeviceUnderTest {
 public:
  explicit V4l2Device(std::string name) : name_(std::move(name)) {}

  std::unique_ptr<Camera> open() override { return open(name_); }
  std::unique_ptr<Camera> open_missing() override { return open("missing"); }
  void unplug() override {}
  void plug() override {}
  bool may_lose_frames() const override { return true; }  // under load the kernel drops

 private:
  static std::unique_ptr<Camera> open(const std::string& name) {
    CameraSettings settings;
    settings.device = name;
    return camera_driver("v4l2").open(settings);
  }

  const std::string name_;
};

}  // namespace

std::unique_ptr<DeviceUnderTest> make_v4l2(std::string& why_not) {
  if (const char* name = std::getenv("PREVIZ_TEST_V4L2")) return std::make_unique<V4l2Device>(name);
  const std::vector<FoundCamera> found = camera_driver("v4l2").find();
  if (!found.empty()) return std::make_unique<V4l2Device>(found.front().device);
  why_not = "this machine has no V4L2 camera (vivid would do: modprobe vivid)";
  return nullptr;
}

}  // namespace previz::test
