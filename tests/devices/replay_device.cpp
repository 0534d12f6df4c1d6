// A take of half a second, looped, whose cable can be pulled.
#include <chrono>

#include "daemon/core/session/replay_camera.hpp"
#include "drivers/faults.hpp"
#include "tests/devices/devices.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test {
namespace {

class ReplayDevice final : public DeviceUnderTest {
 public:
  explicit ReplayDevice(double speed)
      : device_(
            [this, speed] {
              options_.speed = speed;
              return open_replay(directory_ / "take", "observer", options_);
            },
            {}) {
    session::write_small_session(directory_ / "take", 12);
    options_.loop = true;
    options_.position = std::make_shared<ReplayPosition>();
    options_.origin = {std::chrono::steady_clock::now(),
                       session::noise_frame("", 0, PixelFormat::rgb8, 1, 1).timestamp_ns};
  }

  std::unique_ptr<Camera> open() override { return device_.open(); }
  std::unique_ptr<Camera> open_missing() override {
    return open_replay(directory_ / "missing", "observer");
  }
  void unplug() override { device_.unplug(); }
  void plug() override { device_.plug(); }

 private:
  TemporaryDirectory directory_;
  ReplayOptions options_;
  FaultyDevice device_;
};

}  // namespace

std::unique_ptr<DeviceUnderTest> make_replay(std::string&) {
  return std::make_unique<ReplayDevice>(1);
}
std::unique_ptr<DeviceUnderTest> make_unpaced_replay(std::string&) {
  return std::make_unique<ReplayDevice>(0);
}

}  // namespace previz::test
