// Shares out the time that a trade may take, by what each phase brings: the reference says how far
// errors can be told, the sweep draws the page, and the search finds the answers.
#pragma once

#include <optional>

namespace previz::trade {

enum class TradePhase { reference, sweep, live, live_steps, still };

class TradeBudget {
 public:
  // Times are in seconds of any one clock. Without `seconds` there is no end. Without a search the
  // sweep has its time.
  TradeBudget(std::optional<double> seconds, double start_s, bool searches)
      : seconds_(seconds), start_s_(start_s), searches_(searches) {}

  bool is_limited() const { return seconds_.has_value(); }
  double seconds() const { return seconds_.value_or(0); }
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
        return searches_ ? 0.15 : 0.25;
      case TradePhase::sweep:
        return searches_ ? 0.45 : 0.9;
      case TradePhase::live:
        return 0.62;
      case TradePhase::live_steps:
        return 0.70;
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
