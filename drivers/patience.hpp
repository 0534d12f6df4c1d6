// Waits for a camera's next frame by a deadline, however many buffers without one come meanwhile.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "drivers/camera.hpp"
#include "drivers/host_clock.hpp"

namespace previz {

// Calls `attempt(left)` until it returns an event or the deadline has passed; then returns NoFrame.
// An attempt waits at most `left` for a buffer, which may be zero, and takes at most one; it
// returns nothing for a buffer that holds no whole frame, and NoFrame if none came. So a call lasts
// no longer than `timeout` and what the last buffer takes to decode.
template <typename Attempt>
CameraEvent wait_patiently(const HostClock& clock, std::chrono::milliseconds timeout,
                           const Attempt& attempt) {
  const HostClock::Time deadline = clock.now() + timeout;
  for (;;) {
    const std::chrono::nanoseconds left = deadline - clock.now();
    if (std::optional<CameraEvent> event = attempt(std::max(left, std::chrono::nanoseconds(0))))
      return *std::move(event);
    if (clock.now() >= deadline) return NoFrame{};
  }
}

}  // namespace previz
