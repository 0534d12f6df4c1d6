// The V4L2 driver on a stand-in for the kernel's node, which sends at 60 Hz in the host's time. A
// picture shows the exposure that it was taken with, in steps of 100 us.
#include <array>
#include <climits>
#include <cmath>
#include <deque>

#include "drivers/camera_drivers.hpp"
#include "drivers/v4l2/v4l2_camera.hpp"
#include "tests/devices/devices.hpp"
#include "tests/devices/v4l2_fake_node.hpp"

namespace previz::test {
namespace {

constexpr double step_s = 100e-6;  // of the exposure
constexpr int latched_frames = 2;  // that still have the exposure of before

class V4l2StandIn final : public DeviceUnderTest {
 public:
  V4l2StandIn() {
    device_.clock = HostClock{};
    device_.formats = {V4L2_PIX_FMT_GREY};
    device_.picture.pixelformat = V4L2_PIX_FMT_GREY;
    device_.period = {1, 60};
    device_.frame_interval = std::chrono::nanoseconds(1'000'000'000 / 60);
    device_.add_control(V4L2_CID_EXPOSURE_AUTO, 0, 3, V4L2_EXPOSURE_MANUAL);
    device_.add_control(V4L2_CID_EXPOSURE_ABSOLUTE, 1, 255, 50);
    device_.send_frame = [this](v4l2::FakeDevice& device) {
      steps_.push_back(device.values[V4L2_CID_EXPOSURE_ABSOLUTE]);
      if (steps_.size() > latched_frames + 1) steps_.pop_front();
      device.send(std::chrono::nanoseconds(device.next_frame.time_since_epoch()).count(),
                  static_cast<std::uint8_t>(steps_.front()));
    };
    plug();
  }

  std::unique_ptr<Camera> open() override {
    CameraSettings settings;
    settings.device = "stand-in";
    settings.exposure_s = all_exposures[0].exposure_s;
    return open_v4l2(std::make_unique<v4l2::FakeNode>(device_), settings);
  }
  std::unique_ptr<Camera> open_missing() override {
    CameraSettings settings;
    settings.device = "missing";
    return camera_driver("v4l2").open(settings);
  }

  void unplug() override { device_.unplugged = true; }
  void plug() override {
    device_.unplugged = device_.streaming = device_.damages_all = false;
    device_.done.clear();
    device_.frames_to_come = INT_MAX;
  }
  bool spoil() override {
    device_.damages_all = true;
    device_.dequeue_time = std::chrono::milliseconds(5);
    return true;
  }

  bool may_lose_frames() const override { return true; }  // on a busy machine, as the kernel does
  std::span<const Exposure> exposures() const override { return all_exposures; }
  std::optional<bool> shows_its_exposure(const Frame& frame) const override {
    return std::lround(frame.exposure_s / step_s) == frame.bytes.at(0);
  }

 private:
  static constexpr std::array<Exposure, 3> all_exposures{{{0.005, 1}, {0.01, 1}, {0.02, 1}}};

  v4l2::FakeDevice device_;
  std::deque<std::int32_t> steps_;  // exposures that were set when the last frames were taken
};

}  // namespace

std::unique_ptr<DeviceUnderTest> make_v4l2_stand_in(std::string&) {
  return std::make_unique<V4l2StandIn>();
}

}  // namespace previz::test
