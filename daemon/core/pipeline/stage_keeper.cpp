#include "daemon/core/pipeline/stage_keeper.hpp"

#include <utility>

namespace previz::pipeline {

using report::Severity;

StageKeeper::StageKeeper(std::string name, Parts parts,
                         std::chrono::milliseconds Patience::*patience,
                         std::function<void()> begin_anew)
    : name_(std::move(name)),
      parts_(std::move(parts)),
      patience_(parts_.patience.*patience),
      begin_anew_(std::move(begin_anew)),
      pulse_(parts_.liveness, name_),
      backoff_(parts_.delays) {}

bool StageKeeper::rests() const {
  return is_faulty_ && !backoff_.due(parts_.clock.now());
}

void StageKeeper::begin() {
  has_worked_ = true;
  pulse_.begin(patience_);
  if (has_to_begin_anew_) {
    if (begin_anew_) begin_anew_();
    has_to_begin_anew_ = false;
    pulse_.begin(patience_);
  }
  if (parts_.rehearse) parts_.rehearse(name_);
}

// A part that fails at every other frame keeps its long rests: they become short again once it has
// gone well for longer than the longest of them.
void StageKeeper::went_well() {
  pulse_.wait();
  if (!has_worked_) return;
  if (std::exchange(is_faulty_, false)) {
    parts_.reports.settle(name_);
    parts_.reports({Severity::info, name_, "works again"});
    parts_.metrics.count(name_ + ": restarted");
    reported_.clear();
  }
  if (failed_at_ && parts_.clock.now() - *failed_at_ > 2 * parts_.delays.last) {
    failed_at_.reset();
    backoff_.reset();
  }
}

void StageKeeper::failed(const char* why) noexcept {
  is_faulty_ = has_to_begin_anew_ = true;
  try {
    pulse_.wait();
    const HostClock::Time now = parts_.clock.now();
    failed_at_ = now;
    backoff_.failed(now);
    parts_.metrics.count(name_ + ": failed");
    if (std::exchange(reported_, why) == why) return;
    parts_.reports.announce(
        {.severity = Severity::error,
         .source = name_,
         .text = "has failed and is restarting; recording continues: " + std::string(why),
         .notice = report::lasting(name_, "has failed and is restarting: " + std::string(why))});
  } catch (...) {
    // Memory may be short; the count or the report is then missing, and nothing else.
  }
}

}  // namespace previz::pipeline
