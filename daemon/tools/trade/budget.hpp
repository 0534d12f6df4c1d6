// Shares out the time that a trade may take, by what each phase brings: the reference says how far
// errors can be told, the sweep draws the page, and the search finds the answers.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

namespace previz::trade {

enum class TradePhase {
  reference,
  least_reference,
  sweep,
  live,
  live_steps,
  live_rehearsal,
  still
};

class TradeBudget {
 public:
  // Times are in seconds of any one clock. Without `seconds` there is no end. Without a search the
  // sweep has its time.
  TradeBudget(std::optional<double> seconds, double start_s, bool searches)
      : seconds_(seconds), start_s_(start_s), searches_(searches) {}

  bool is_limited() const { return seconds_.has_value(); }
  double seconds() const { return seconds_.value_or(0); }
  // Returns what is left of a phase, at least 0; without an end, infinity.
  double left(TradePhase phase, double now_s) const {
    return seconds_ ? std::max(start_s_ + share_of(phase) * *seconds_ - now_s, 0.0)
                    : std::numeric_limits<double>::infinity();
  }
  // Returns the seconds in all with which a phase ends after so many.
  double for_phase(TradePhase phase, double seconds) const { return seconds / share_of(phase); }
  // What a phase leaves over falls to the next.
  bool is_over(TradePhase phase, double now_s) const {
    return seconds_ && now_s - start_s_ >= share_of(phase) * *seconds_;
  }

 private:
  // When a phase ends, as a share of the whole. What is left after the last is for a measurement
  // that has begun, and for the pictures of the page.
  double share_of(TradePhase phase) const {
    switch (phase) {
      case TradePhase::reference:
        return searches_ ? 0.2 : 0.3;
      case TradePhase::least_reference:
        return 0.35;
      case TradePhase::sweep:
        return searches_ ? 0.45 : 0.9;
      case TradePhase::live:
        return 0.60;
      case TradePhase::live_steps:
        return 0.67;
      case TradePhase::live_rehearsal:
        return 0.80;
      case TradePhase::still:
        return 0.92;
    }
    return 1;
  }

  std::optional<double> seconds_;
  double start_s_;
  bool searches_;
};

// A probe is not made, because its phase is over.
struct OutOfTime {};

}  // namespace previz::trade
