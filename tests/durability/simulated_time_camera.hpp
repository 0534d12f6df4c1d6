// A camera in simulated time that knows when each of its pictures was really taken.
#pragma once

#include "drivers/camera.hpp"
#include "drivers/clock_map.hpp"
#include "drivers/frame_order.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/other_clock.hpp"
#include "tests/durability/simulated_time.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// Where the stamps of a camera's frames come from; its driver makes of them what the driver of that
// name does.
enum class Stamps {
  own_clock,   // aravis: a clock that drifts
  monotonic,   // v4l2: the kernel's CLOCK_MONOTONIC
  since_boot,  // libcamera: CLOCK_BOOTTIME
};

class SimulatedDevice {
 public:
  static constexpr std::int64_t second = 1'000'000'000, interval_ns = second / 24;
  static constexpr std::int64_t least_delay_ns = 3'000'000;  // from the exposure to the arrival

  // What was true of a frame that was delivered.
  struct Sent {
    std::int64_t captured_ns, arrival_ns;  // CLOCK_MONOTONIC
    std::int64_t wall_ns;                  // CLOCK_REALTIME when it was delivered
    Stamps stamps;
    bool is_settled;  // for half a minute nothing has changed for the camera's clock
  };

  SimulatedDevice(SimulatedTime& time, unsigned seed) : time_(time), random_(seed) {}

  // These may be called from any thread, and act on the frames that have not been waited for yet.
  void plug(Stamps stamps, double drift_ppm) {
    const std::lock_guard lock(mutex_);
    is_plugged_ = true;
    stamps_ = stamps;
    drift_ = 1e-6 * drift_ppm;
    drifts_from_ns_ = world_ns();
    drifted_ns_ = 0;
    settles_from_ns_ = time_.now_ns();
  }
  void unplug() {
    const std::lock_guard lock(mutex_);
    is_plugged_ = false;
  }
  // The camera grows warmer.
  void drift(double ppm) {
    const std::lock_guard lock(mutex_);
    drifted_ns_ += drift_ * static_cast<double>(world_ns() - drifts_from_ns_);
    drifts_from_ns_ = world_ns();
    drift_ = 1e-6 * ppm;
    settles_from_ns_ = time_.now_ns();
  }
  void stall_until(std::int64_t time_ns) {
    const std::lock_guard lock(mutex_);
    stalled_until_ns_ = time_ns;
  }
  // One call of the driver returns so late.
  void hang_until(std::int64_t time_ns) {
    const std::lock_guard lock(mutex_);
    hung_until_ns_ = time_ns;
  }
  void jitter(std::int64_t most_ns) {
    const std::lock_guard lock(mutex_);
    most_jitter_ns_ = most_ns;
  }

  std::map<std::int64_t, Sent> sent() const {  // by the stamp
    const std::lock_guard lock(mutex_);
    return sent_;
  }
  Sent sent(std::int64_t stamp_ns) const {
    const std::lock_guard lock(mutex_);
    return sent_.at(stamp_ns);
  }
  std::uint64_t dropped() const {  // frames that never came, before one that did
    const std::lock_guard lock(mutex_);
    return dropped_;
  }
  std::int64_t opened_ns() const {
    const std::lock_guard lock(mutex_);
    return opened_ns_;
  }

  std::unique_ptr<Camera> open();

 private:
  class Opened;
  struct Plan {
    std::int64_t captured_ns, arrival_ns, world_ns, device_ns, since_boot_ns;
    std::uint32_t sequence;
  };

  std::int64_t world_ns() const { return time_.boot_ns(); }
  std::int64_t device_ns(std::int64_t world_ns) const {
    return 7'000 * second + world_ns +
           static_cast<std::int64_t>(drifted_ns_ +
                                     drift_ * static_cast<double>(world_ns - drifts_from_ns_));
  }

  SimulatedTime& time_;
  mutable std::mutex mutex_;
  std::mt19937 random_;
  bool is_plugged_ = false;
  Stamps stamps_ = Stamps::monotonic;
  double drift_ = 0, drifted_ns_ = 0;
  std::int64_t drifts_from_ns_ = 0;
  std::int64_t stalled_until_ns_ = 0, hung_until_ns_ = 0, most_jitter_ns_ = 8'000'000;
  std::int64_t opened_ns_ = 0, settles_from_ns_ = 0;
  std::uint64_t dropped_ = 0;
  std::map<std::int64_t, Sent> sent_;
};

// One opening of the device.
class SimulatedDevice::Opened final : public Camera {
 public:
  explicit Opened(SimulatedDevice& device)
      : device_(device), boottime_(read_beside_monotonic(CLOCK_BOOTTIME)), order_(counters_) {}

  std::string name() const override { return "simulated"; }
  CameraFormat format() const override { return {PixelFormat::rgb8, width, height, 24}; }
  void start() override { next_ns_ = device_.time_.now_ns() + interval_ns; }
  void stop() override {}
  bool set_exposure(double, double) override { return false; }
  DeviceCounters counters() const override { return counters_; }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    const std::int64_t until_ns = monotonic_ns() + std::chrono::nanoseconds(timeout).count();
    std::unique_lock lock(device_.mutex_);
    const std::int64_t hung_until_ns = std::exchange(device_.hung_until_ns_, 0);
    if (!device_.is_plugged_) return DeviceTrouble{name(), "was unplugged", true};
    if (!plan_) plan();
    lock.unlock();
    if (hung_until_ns > 0) return hang(hung_until_ns);
    const bool comes = plan_->arrival_ns <= until_ns;
    device_.time_.sleep_exactly_until(comes ? plan_->arrival_ns : until_ns);
    return comes ? CameraEvent(deliver()) : CameraEvent(NoFrame{});
  }

 private:
  static constexpr int width = 48, height = 36;

  // What is filled meanwhile is lost.
  CameraEvent hang(std::int64_t until_ns) {
    device_.time_.sleep_exactly_until(until_ns);
    plan_.reset();
    next_ns_ = std::max(next_ns_, until_ns);
    return NoFrame{};
  }

  void plan() {
    const std::int64_t captured_ns = std::max(next_ns_, device_.stalled_until_ns_);
    next_ns_ = captured_ns + interval_ns;
    const std::int64_t asleep_ns = device_.time_.boot_ns() - device_.time_.now_ns();
    const auto delay_ns =
        static_cast<std::int64_t>(device_.random_() % (device_.most_jitter_ns_ + 1));
    last_arrival_ns_ = std::max(captured_ns + least_delay_ns + delay_ns, last_arrival_ns_ + 1000);
    const bool drops = sequence_ > 0 && device_.random_() % 256 == 0;
    if (drops) next_ns_ += interval_ns;
    if (skipped_) ++device_.dropped_;
    plan_ = {captured_ns,
             last_arrival_ns_,
             captured_ns + asleep_ns,
             device_.device_ns(captured_ns + asleep_ns),
             captured_ns + asleep_ns,
             sequence_ += skipped_ ? 2 : 1};
    skipped_ = drops;
  }

  FramePtr deliver() {
    const Plan plan = *std::exchange(plan_, std::nullopt);
    auto frame = std::make_shared<Frame>();
    frame->source = "observer";
    frame->sequence = order_.sequence_of(plan.sequence);
    frame->arrival_ns = monotonic_ns();
    frame->exposure_s = frame->exposure = 0.01;
    frame->width = width;
    frame->height = height;
    frame->bytes.assign(frame_bytes(frame->format, width, height),
                        static_cast<std::uint8_t>(plan.sequence));
    const std::lock_guard lock(device_.mutex_);
    frame->timestamp_ns = stamp(plan, frame->arrival_ns);
    device_.sent_[frame->timestamp_ns] = {
        plan.captured_ns, frame->arrival_ns, device_.time_.wall_ns(), device_.stamps_,
        plan.captured_ns > device_.settles_from_ns_ + 31 * second};
    return frame;
  }

  std::int64_t stamp(const Plan& plan, std::int64_t arrival_ns) {
    switch (device_.stamps_) {
      case Stamps::own_clock:
        return map_.to_host(plan.device_ns, arrival_ns);
      case Stamps::monotonic:
        return order_.time_of(plan.captured_ns, arrival_ns);
      default:
        return order_.time_of(sensor_time_ns(boottime_, plan.since_boot_ns, arrival_ns),
                              arrival_ns);
    }
  }

  SimulatedDevice& device_;
  DeviceCounters counters_;
  OtherClock boottime_;
  FrameOrder order_;
  ClockMap map_;
  std::int64_t next_ns_ = 0, last_arrival_ns_ = 0;
  std::uint32_t sequence_ = 0;
  bool skipped_ = false;
  std::optional<Plan> plan_;
};

inline std::unique_ptr<Camera> SimulatedDevice::open() {
  const std::lock_guard lock(mutex_);
  if (!is_plugged_) throw Error("simulated: is not there");
  opened_ns_ = settles_from_ns_ = time_.now_ns();
  return std::make_unique<Opened>(*this);
}

}  // namespace previz::test
