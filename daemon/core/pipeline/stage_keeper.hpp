// Keeps a part of the pipeline going that may fail: what it throws ends nothing but this piece of
// work.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <optional>
#include <string>

#include "daemon/core/pipeline/liveness.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/report/reports.hpp"
#include "drivers/backoff.hpp"
#include "drivers/host_clock.hpp"

namespace previz::pipeline {

// A failure is reported to the journal, the display and the bus, and counted; the same failure over
// and over is reported once. The part then rests, at first briefly and longer with every further
// failure, and begins anew. A keeper belongs to one thread.
class StageKeeper {
 public:
  struct Parts {  // references outlive the keeper
    report::Reports& reports;
    Metrics& metrics;
    Liveness& liveness;
    Patience patience = {};
    // Called with the part's name before each piece of work; what a test throws in it is a failure
    // of that part.
    std::function<void(const std::string&)> rehearse = {};
    BackoffLimits delays{std::chrono::milliseconds(250), std::chrono::milliseconds(10'000)};
    HostClock clock = {};
  };

  // `name` is the part's in reports, metrics and rehearsals. A piece of work may take as long as
  // `patience` says before its thread counts as hung. `begin_anew` makes the part again after a
  // failure; it may throw, which is the next failure.
  StageKeeper(std::string name, Parts parts, std::chrono::milliseconds Patience::*patience,
              std::function<void()> begin_anew = {});

  // Does a piece of work. Returns false if it failed, or if the part rests and nothing was done.
  // Throws nothing.
  template <class Work>
  bool attempt(Work&& work) noexcept {
    if (rests()) return false;
    try {
      begin();
      work();
      went_well();
      return true;
    } catch (const std::exception& error) {
      failed(error.what());
    } catch (...) {
      failed("unknown exception");
    }
    return false;
  }

  // Call this within a piece of work where it waits for others; it may then take any time, until it
  // goes on.
  void waits() { pulse_.wait(); }
  void goes_on() { pulse_.begin(patience_); }
  // Call this within a piece of work where there was nothing to do. A part that has failed does not
  // count as working again by it.
  void had_nothing_to_do() { has_worked_ = false; }

 private:
  bool rests() const;
  void begin();
  void went_well();
  void failed(const char* why) noexcept;

  const std::string name_;
  const Parts parts_;
  const std::chrono::milliseconds patience_;
  const std::function<void()> begin_anew_;
  Liveness::Pulse pulse_;
  Backoff backoff_;
  bool has_worked_ = true;  // in the last piece of work
  bool is_faulty_ = false;  // since the last failure no work has ended well
  bool has_to_begin_anew_ = false;
  std::optional<HostClock::Time> failed_at_;  // absent: the next failure counts as the first
  std::string reported_;  // the failure that was reported last; empty once the part works again
};

}  // namespace previz::pipeline
