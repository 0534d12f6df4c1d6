// Makes the kernel's sequence numbers and times of video frames increase, whatever the driver below
// does.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "drivers/device.hpp"

namespace previz {

class FrameOrder {
 public:
  // Irregularities are counted in `counters`.
  explicit FrameOrder(DeviceCounters& counters) : counters_(counters) {}

  // Must be called at each start, since the kernel then counts from 0 again, in 32 bits.
  void restart() { device_sequence_.reset(); }

  std::uint64_t sequence_of(std::uint32_t device_sequence) {
    const std::uint32_t step =
        device_sequence_ ? device_sequence - *device_sequence_ : std::uint32_t{1};
    device_sequence_ = device_sequence;
    // A driver whose step is zero or backwards does not count.
    const std::uint32_t forward = step == 0 || step > 0x7fffffff ? 1 : step;
    if (forward > 1) counters_["frames missing in the sequence"] += forward - 1;
    return sequence_ += forward;
  }

  // Returns the stamp, strictly increasing and at most the arrival. The arrival stands in for the
  // stamp of a driver that has no monotonic stamps, whose stamps stand still, or who stamps a frame
  // with a time long ago.
  std::int64_t time_of(std::optional<std::int64_t> stamp_ns, std::int64_t arrival_ns) {
    if (!stamp_ns) ++counters_["frames without a kernel time stamp"];
    const bool cannot_be =
        stamp_ns && (*stamp_ns == last_stamp_ns_ || *stamp_ns < arrival_ns - oldest_ns);
    if (cannot_be) ++counters_["frames with an impossible time stamp"];
    if (stamp_ns) last_stamp_ns_ = stamp_ns;
    const std::int64_t time_ns =
        std::min(arrival_ns, cannot_be ? arrival_ns : stamp_ns.value_or(arrival_ns));
    return last_time_ns_ = std::max(time_ns, last_time_ns_ + 1);
  }

 private:
  // All of a device's buffers are filled sooner than that, so that none of them can be older.
  static constexpr std::int64_t oldest_ns = 10'000'000'000;

  DeviceCounters& counters_;
  std::optional<std::uint32_t> device_sequence_;
  std::uint64_t sequence_ = 0;
  std::optional<std::int64_t> last_stamp_ns_;
  std::int64_t last_time_ns_ = 0;
};

}  // namespace previz
