// Removes the bouncing from one contact's edges.
#pragma once

#include <cstdint>
#include <optional>

namespace previz {

// The first edge counts at once, so that nothing is late. Later edges within the window are
// bouncing, and only the level on which they settle counts.
class Debouncer {
 public:
  explicit Debouncer(std::int64_t window_ns) : window_ns_(window_ns) {}

  // Takes the contact's edges in order of time. Returns true if the reported level changes;
  // pressed() is then the new level.
  bool edge(bool closed, std::int64_t time_ns) {
    const bool settled = settle(time_ns);
    closed_ = closed;
    return take(time_ns) || settled;
  }

  // Must be called at settles_ns() or later. Returns true if the contact settled on another level
  // than the one last reported.
  bool settle(std::int64_t now_ns) {
    if (!quiet_until_ns_ || now_ns < *quiet_until_ns_) return false;
    const std::int64_t end_ns = *quiet_until_ns_;
    quiet_until_ns_.reset();
    return take(end_ns);
  }

  // Forgets a contact that is gone: it counts as released and has nothing to settle.
  void reset() {
    closed_ = pressed_ = false;
    quiet_until_ns_.reset();
  }

  bool pressed() const { return pressed_; }          // the level last reported
  std::int64_t told_ns() const { return told_ns_; }  // the time of its edge
  std::optional<std::int64_t> settles_ns() const { return quiet_until_ns_; }

 private:
  bool take(std::int64_t time_ns) {
    if (quiet_until_ns_ || closed_ == pressed_) return false;
    pressed_ = closed_;
    told_ns_ = time_ns;
    if (window_ns_ > 0) quiet_until_ns_ = time_ns + window_ns_;
    return true;
  }

  std::int64_t window_ns_;
  bool closed_ = false, pressed_ = false;
  std::int64_t told_ns_ = 0;
  std::optional<std::int64_t> quiet_until_ns_;
};

}  // namespace previz
