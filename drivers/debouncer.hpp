// One contact's edges without its bouncing.
#pragma once

#include <cstdint>
#include <optional>

namespace previz {

// The first edge counts at once, so that nothing is late; what follows within the window is
// bouncing, and only the level it settles on counts.
class Debouncer {
 public:
  explicit Debouncer(std::int64_t window_ns) : window_ns_(window_ns) {}

  // An edge of the contact, in order of time. True where it is to be told; pressed() then says
  // what.
  bool edge(bool closed, std::int64_t time_ns) {
    const bool settled = settle(time_ns);
    closed_ = closed;
    return take(time_ns) || settled;
  }

  // To be called at settles_ns() or later: true where the contact settled on another level than it
  // was told.
  bool settle(std::int64_t now_ns) {
    if (!quiet_until_ns_ || now_ns < *quiet_until_ns_) return false;
    const std::int64_t end_ns = *quiet_until_ns_;
    quiet_until_ns_.reset();
    return take(end_ns);
  }

  // The contact is gone: released, with nothing to settle.
  void reset() {
    closed_ = pressed_ = false;
    quiet_until_ns_.reset();
  }

  bool pressed() const { return pressed_; }          // as last told
  std::int64_t told_ns() const { return told_ns_; }  // when that was
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
