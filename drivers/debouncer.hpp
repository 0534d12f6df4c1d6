// Removes the bouncing from one contact's edges, and the presses that no hand makes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "drivers/device.hpp"

namespace previz {

// Leaves out the presses of a button that babbles: of a wet contact, a broken cable, a hostile
// device. A press is left out if there were `most_presses` within the second before it; from then
// on every press is, until there was none for a second.
class PressLimit {
 public:
  // More than a hand makes on purpose.
  static constexpr std::size_t most_presses = 8;
  static constexpr std::int64_t period_ns = 1'000'000'000;

  enum class Verdict {
    counts,
    begins_to_babble,  // left out; the one before it counted
    babbles,           // left out
  };

  // Takes the presses in order of time.
  Verdict judge(std::int64_t time_ns) {
    const bool quiet = !last_ns_ || time_ns - *last_ns_ >= period_ns;
    last_ns_ = time_ns;
    if (babbles_ && !quiet) return Verdict::babbles;
    while (!counted_ns_.empty() && time_ns - counted_ns_.front() >= period_ns)
      counted_ns_.pop_front();
    babbles_ = counted_ns_.size() >= most_presses;
    if (babbles_) return Verdict::begins_to_babble;
    counted_ns_.push_back(time_ns);
    return Verdict::counts;
  }

 private:
  std::deque<std::int64_t> counted_ns_;  // presses of the last second that count
  std::optional<std::int64_t> last_ns_;  // the last press, whether it counts or not
  bool babbles_ = false;
};

// The name of the counter of such presses.
inline constexpr const char* presses_babbled = "presses ignored, faster than any hand";

// Returns the trouble to report when a button begins to babble.
inline DeviceTrouble babbling(const std::string& device, const std::string& button) {
  return {device, "\"" + button +
                      "\" is pressed faster than any hand can; it is ignored until it is quiet "
                      "for a second"};
}

// The first edge counts at once, so that nothing is late. Later edges within the window are
// bouncing, and only the level on which they settle counts. Presses of a contact that babbles do
// not count; it is then taken for released.
class Debouncer {
 public:
  explicit Debouncer(std::int64_t window_ns) : window_ns_(window_ns) {}

  // Takes the contact's edges in order of time. Returns true if the reported level changes;
  // pressed() is then the new level.
  bool edge(bool closed, std::int64_t time_ns) {
    const bool settled = settle(time_ns);
    closed_ = closed;
    if (!closed) left_out_ = false;
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
    closed_ = pressed_ = left_out_ = false;
    quiet_until_ns_.reset();
  }

  bool pressed() const { return pressed_; }          // the level last reported
  std::int64_t told_ns() const { return told_ns_; }  // the time of its edge
  std::optional<std::int64_t> settles_ns() const { return quiet_until_ns_; }
  std::uint64_t presses_left_out() const { return presses_left_out_; }
  std::uint64_t times_babbled() const { return times_babbled_; }

 private:
  bool take(std::int64_t time_ns) {
    if (quiet_until_ns_ || closed_ == pressed_ || left_out_) return false;
    if (closed_ && leaves_out(time_ns)) return false;
    pressed_ = closed_;
    told_ns_ = time_ns;
    if (window_ns_ > 0) quiet_until_ns_ = time_ns + window_ns_;
    return true;
  }

  bool leaves_out(std::int64_t time_ns) {
    const PressLimit::Verdict verdict = limit_.judge(time_ns);
    if (verdict == PressLimit::Verdict::begins_to_babble) ++times_babbled_;
    left_out_ = verdict != PressLimit::Verdict::counts;
    if (left_out_) ++presses_left_out_;
    return left_out_;
  }

  std::int64_t window_ns_;
  bool closed_ = false, pressed_ = false;
  bool left_out_ = false;  // the present press does not count
  std::int64_t told_ns_ = 0;
  std::optional<std::int64_t> quiet_until_ns_;
  PressLimit limit_;
  std::uint64_t presses_left_out_ = 0, times_babbled_ = 0;
};

}  // namespace previz
