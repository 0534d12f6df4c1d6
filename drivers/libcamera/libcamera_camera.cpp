#include "drivers/libcamera/libcamera_camera.hpp"

#include <algorithm>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/frame_order.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/libcamera/device.hpp"
#include "drivers/other_clock.hpp"
#include "drivers/patience.hpp"

namespace previz {
namespace {

using libcam::Completed;

// Cameras that do not report exposures need this many frames: the requests queued ahead, and what
// UVC takes besides.
constexpr int libcamera_settle_frames = 8;

class LibcameraCamera final : public Camera {
 public:
  explicit LibcameraCamera(const CameraSettings& settings)
      : settings_(settings), device_(settings), ledger_({}, 0), order_(counters_) {
    if (settings.exposure_s)
      exposure_ = device_.possible({*settings.exposure_s, settings.gain.value_or(1)});
    ledger_ = ExposureLedger(exposure_.value_or(Exposure{}), libcamera_settle_frames);
  }
  ~LibcameraCamera() override { stop(); }
  LibcameraCamera(const LibcameraCamera&) = delete;
  LibcameraCamera& operator=(const LibcameraCamera&) = delete;

  std::string name() const override { return settings_.device; }
  CameraFormat format() const override { return device_.agreed().format; }
  DeviceCounters counters() const override { return counters_; }
  std::vector<std::string> doubts() const override { return device_.agreed().doubts; }

  void start() override {
    if (device_.streaming()) return;
    order_.restart();
    device_.start(exposure_);
    if (std::exchange(changed_, false)) ledger_.changed(monotonic_ns(), monotonic_ns(), *exposure_);
  }

  void stop() override { device_.stop(); }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (!lost_.empty()) return DeviceTrouble{name(), lost_, true};
    if (!device_.streaming()) return NoFrame{};
    return wait_patiently({}, timeout, [this](std::chrono::nanoseconds left) {
      return attempt(std::chrono::ceil<std::chrono::milliseconds>(left));
    });
  }

  bool set_exposure(double exposure_s, double gain) override {
    const libcam::Agreed& agreed = device_.agreed();
    if (!agreed.drives_exposure || !(exposure_s > 0) || (gain != 1 && !agreed.drives_gain))
      return false;
    exposure_ = device_.possible({exposure_s, gain});
    changed_ = true;
    return true;
  }

 private:
  // Waits for a buffer; returns nothing for one without a whole frame.
  std::optional<CameraEvent> attempt(std::chrono::milliseconds left) {
    const std::optional<Completed> completed = device_.wait(left);
    if (device_.unplugged()) lost_ = "was unplugged";
    if (!lost_.empty()) return DeviceTrouble{name(), lost_, true};
    if (!completed) return NoFrame{};
    FramePtr frame = read(*completed);
    queue_again(completed->buffer);
    if (!frame) return std::nullopt;
    return frame;
  }

  // Queues a buffer again; a new exposure goes with the next request.
  void queue_again(std::size_t buffer) {
    const bool changed = std::exchange(changed_, false);
    const std::int64_t before_ns = monotonic_ns();
    if (!device_.queue(buffer, changed ? exposure_ : std::nullopt)) lost_ = "rejects its buffers";
    if (changed) ledger_.changed(before_ns, monotonic_ns(), *exposure_);
  }

  FramePtr read(const Completed& completed) {
    const std::int64_t arrival_ns = monotonic_ns();
    if (completed.fate == Completed::Fate::given_up)
      return left_out("frames abandoned by the receiver");
    const std::uint64_t sequence = order_.sequence_of(completed.sequence);
    if (completed.fate == Completed::Fate::damaged)
      return left_out("frames the device reports as damaged");
    if (completed.overfull) return left_out("frames longer than their buffer");
    auto frame = std::make_shared<Frame>();
    const libcam::Agreed& agreed = device_.agreed();
    if (convert::convert({agreed.wire, agreed.format.width, agreed.format.height, agreed.stride,
                          bytes_of(completed)},
                         *frame))
      return left_out("frames cut short");
    frame->source = settings_.source;
    frame->sequence = sequence;
    frame->arrival_ns = arrival_ns;
    std::optional<std::int64_t> stamp_ns;
    if (completed.timestamp_ns > 0)
      stamp_ns = sensor_time_ns(boottime_, completed.timestamp_ns, arrival_ns);
    frame->timestamp_ns = order_.time_of(stamp_ns, arrival_ns);
    // A pipeline may report an exposure that has no gain yet.
    const std::optional<Exposure> exposure =
        ledger_.of_frame(frame->timestamp_ns, completed.exposure_s, completed.gain);
    if (!exposure) return left_out("frames during an exposure change");
    apply_exposure(*frame, *exposure, settings_.responsivity);
    return frame;
  }

  FramePtr left_out(const char* why) {
    ++counters_[why];
    return nullptr;
  }

  // Returns the planes one after the other, as the conversions want them.
  std::span<const std::uint8_t> bytes_of(const Completed& completed) {
    if (completed.planes.size() == 1) return completed.planes.front();
    const libcam::Agreed& agreed = device_.agreed();
    convert::join_planes(agreed.wire, agreed.format.width, agreed.format.height, agreed.stride,
                         completed.planes, joined_);
    return joined_;
  }

  const CameraSettings settings_;
  libcam::Device device_;
  std::optional<Exposure> exposure_;  // requested; none: the camera's own
  bool changed_ = false;              // exposure_ was not yet sent to the camera
  ExposureLedger ledger_;
  std::vector<std::uint8_t> joined_;
  std::string lost_;  // why nothing more comes; empty while all is well
  DeviceCounters counters_;
  OtherClock boottime_{read_beside_monotonic(CLOCK_BOOTTIME)};
  FrameOrder order_;
};

}  // namespace

std::unique_ptr<Camera> open_libcamera(const CameraSettings& settings) {
  return std::make_unique<LibcameraCamera>(settings);
}

std::vector<FoundCamera> find_libcamera() {
  std::vector<FoundCamera> found;
  for (const libcam::Listed& listed : libcam::list_cameras())
    found.push_back({"libcamera", listed.id, listed.model});
  return found;
}

std::optional<usb::Place> usb_place_of_libcamera(const std::string& device) {
  const std::optional<libcam::UvcProduct> uvc = libcam::uvc_product(device);
  return uvc ? usb::place_of_product(uvc->vendor, uvc->product) : std::nullopt;
}

}  // namespace previz
