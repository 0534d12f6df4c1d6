#include "daemon/core/live/pass_meter.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

namespace previz::live {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

// Passes that take about as long as each other keep their places from reading to reading.
bool is_still_in_order(const std::vector<PassTimes::Pass>& passes) {
  double shortest_ms = std::numeric_limits<double>::infinity();
  return std::ranges::all_of(passes, [&](const PassTimes::Pass& pass) {
    const bool is_behind_longer = pass.ms <= 1.2 * shortest_ms + 0.02;
    shortest_ms = std::min(shortest_ms, pass.ms);
    return is_behind_longer;
  });
}

}  // namespace

bool PassMeter::add(std::int64_t now_ns, render::DeviceTimes times, bool is_round) {
  if (is_round != reading_.is_of_rounds) {
    recent_.clear();
    reading_ = {.is_timed = reading_.is_timed, .is_of_rounds = is_round, .passes = {}};
    next_ns_ = now_ns;
  }
  recent_.push_back({now_ns, std::move(times)});
  while (now_ns - recent_.front().at_ns > second_ns) recent_.pop_front();
  if (now_ns < next_ns_) return false;
  next_ns_ = now_ns + second_ns / 2;
  read_off();
  return true;
}

void PassMeter::read_off() {
  std::vector<PassTimes::Pass>& passes = reading_.passes;
  const bool is_first = passes.empty();
  for (PassTimes::Pass& pass : passes) pass.ms = 0;
  reading_.waited_ms = reading_.untimed = 0;
  const double share = 1 / static_cast<double>(recent_.size());
  for (const auto& [at_ns, times] : recent_) {
    reading_.is_timed |= times.submissions > 0;
    reading_.waited_ms += share * times.waited_ms;
    reading_.untimed += share * static_cast<double>(times.untimed);
    for (const auto& [name, count, ms] : times.passes) pass_named(name).ms += share * ms;
  }
  std::erase_if(passes, [](const PassTimes::Pass& pass) { return pass.ms == 0; });
  if (is_first || !is_still_in_order(passes))
    std::ranges::stable_sort(passes, std::greater(), &PassTimes::Pass::ms);
}

PassTimes::Pass& PassMeter::pass_named(const std::string& name) {
  const auto known = std::ranges::find(reading_.passes, name, &PassTimes::Pass::name);
  if (known != reading_.passes.end()) return *known;
  return reading_.passes.emplace_back(PassTimes::Pass{name, 0});
}

}  // namespace previz::live
