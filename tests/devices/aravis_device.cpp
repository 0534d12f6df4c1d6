// Aravis' own fake GigE Vision camera on the loopback network: real GVCP and GVSP over UDP. It
// sends a recorded take through its fill callback, with the exposure it was set to in the first
// four bytes.
#include <arv.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>

#include "drivers/camera_drivers.hpp"
#include "drivers/error.hpp"
#include "tests/devices/devices.hpp"
#include "tests/devices/private_network.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test {
namespace {

constexpr int width = 64, height = 48, take_frames = 7;
constexpr double rate_hz = 40;

class AravisDevice final : public DeviceUnderTest {
 public:
  // `lost` is the share of the stream's packets that do not arrive.
  explicit AravisDevice(double lost, bool triggered = false) : lost_(lost), triggered_(triggered) {
    for (int i = 0; i < take_frames; ++i)
      take_.push_back(session::noise_frame("observer", i, PixelFormat::gray8, width, height).bytes);
    plug();
  }
  ~AravisDevice() override { unplug(); }

  bool is_running() const { return camera_ && arv_gv_fake_camera_is_running(camera_); }

  std::unique_ptr<Camera> open() override {
    CameraSettings settings;
    settings.device = address_;
    if (triggered_)
      settings.trigger = "software";
    else
      settings.rate_hz = rate_hz;
    settings.exposure_s = 0.010;
    settings.packet_size = 1500;  // three packets a frame, a leader and a trailer
    return camera_driver("aravis").open(settings);
  }
  std::unique_ptr<Camera> open_missing() override {
    CameraSettings settings;
    settings.device = "missing";
    return camera_driver("aravis").open(settings);
  }

  void unplug() override {
    if (camera_) g_object_unref(camera_);
    camera_ = nullptr;
  }

  void plug() override {
    camera_ = arv_gv_fake_camera_new(address_.c_str(), "previz-test");
    if (!is_running()) return;
    g_object_set(camera_, "gvsp-lost-ratio", lost_, nullptr);
    fake_ = arv_gv_fake_camera_get_fake_camera(camera_);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
    arv_fake_camera_set_fill_pattern(
        fake_,
        [](ArvBuffer* buffer, void* self, guint32 exposure_us, guint32, ArvPixelFormat) {
          static_cast<AravisDevice*>(self)->fill(*buffer, exposure_us);
        },
        this);
  }

  bool may_lose_frames() const override { return lost_ > 0; }
  bool spoil() override {
    if (triggered_) return false;  // no frame, no next trigger
    g_object_set(camera_, "gvsp-lost-ratio", 0.5, nullptr);
    return true;
  }

  std::span<const Exposure> exposures() const override {
    static constexpr std::array<Exposure, 3> all{{{0.001, 1}, {0.004, 1}, {0.016, 1}}};
    return all;
  }

  // True if the frame carries the exposure that was set, and a picture of the take bit for bit.
  std::optional<bool> shows_its_exposure(const Frame& frame) const override {
    std::uint32_t exposure_us = 0;
    std::memcpy(&exposure_us, frame.bytes.data(), 4);
    const bool bit_exact = std::ranges::any_of(take_, [&](const auto& bytes) {
      return std::equal(bytes.begin() + 4, bytes.end(), frame.bytes.begin() + 4, frame.bytes.end());
    });
    return bit_exact && exposure_us == std::lround(1e6 * frame.exposure_s);
  }

 private:
  // On the camera's own thread. The buffer does not know its size yet.
  void fill(ArvBuffer& buffer, std::uint32_t exposure_us) {
    auto* to = const_cast<void*>(arv_buffer_get_data(&buffer, nullptr));
    const auto& bytes = take_[sent_++ % take_frames];
    std::memcpy(to, bytes.data(), std::min(arv_fake_camera_get_payload(fake_), bytes.size()));
    std::memcpy(to, &exposure_us, 4);
  }

  const std::string address_ = "127.0.0.1";
  const double lost_;
  const bool triggered_;
  std::vector<std::vector<std::uint8_t>> take_;
  std::atomic<std::size_t> sent_ = 0;
  ArvGvFakeCamera* camera_ = nullptr;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
};

std::unique_ptr<DeviceUnderTest> make(double lost, bool triggered, std::string& why_not) {
  const bool is_private = enter_private_network();  // the camera's control port is fixed
  auto device = std::make_unique<AravisDevice>(lost, triggered);
  if (device->is_running()) return device;
  if (is_private)
    throw Error("Aravis' fake camera cannot listen on 127.0.0.1, in a network of its own");
  why_not =
      "Aravis' fake camera cannot listen on 127.0.0.1, and this process may have no network of"
      " its own";
  return nullptr;
}

}  // namespace

std::unique_ptr<DeviceUnderTest> make_aravis(std::string& why_not) {
  return make(0, false, why_not);
}
std::unique_ptr<DeviceUnderTest> make_lossy_aravis(std::string& why_not) {
  return make(0.1, false, why_not);
}
std::unique_ptr<DeviceUnderTest> make_triggered_aravis(std::string& why_not) {
  return make(0, true, why_not);
}

}  // namespace previz::test
