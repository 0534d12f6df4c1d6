#include "daemon/pipeline/metrics.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace previz::pipeline {
namespace {

std::uint64_t& count_named(std::map<std::string, std::uint64_t>& counts, const std::string& name) {
  const auto known = counts.find(name);
  if (known != counts.end()) return known->second;
  return counts[counts.size() < Metrics::most_names ? name : Metrics::other_names];
}

}  // namespace

double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const double rank = std::ceil(fraction * static_cast<double>(values.size()));
  const auto index = static_cast<std::size_t>(std::max(rank, 1.0)) - 1;
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

void Metrics::worked(const std::string& stage, double seconds) {
  const std::lock_guard lock(mutex_);
  ++stages_[stage].frames;
  stages_[stage].busy_s += seconds;
}

void Metrics::busy(const std::string& stage, double seconds) {
  const std::lock_guard lock(mutex_);
  stages_[stage].busy_s += seconds;
}

void Metrics::dropped(const std::string& stage, const std::string& cause, std::uint64_t frames) {
  if (frames == 0) return;
  const std::lock_guard lock(mutex_);
  count_named(stages_[stage].dropped, cause) += frames;
}

void Metrics::count(const std::string& event, std::uint64_t times) {
  const std::lock_guard lock(mutex_);
  count_named(counts_, event) += times;
}

void Metrics::device_counted(const std::string& device, const DeviceCounters& more) {
  const std::lock_guard lock(mutex_);
  for (const auto& [what, count] : more) devices_[device][what] += count;
}

void Metrics::shown(double latency_s) {
  const std::lock_guard lock(mutex_);
  if (latencies_s_.size() < latency_window) {
    latencies_s_.push_back(latency_s);
  } else {
    latencies_s_[next_latency_] = latency_s;
    next_latency_ = (next_latency_ + 1) % latency_window;
  }
}

MetricsSnapshot Metrics::snapshot(double seconds) const {
  const std::lock_guard lock(mutex_);
  return {seconds,
          stages_,
          counts_,
          devices_,
          quantile(latencies_s_, 0.50),
          quantile(latencies_s_, 0.99)};
}

std::string to_json(const MetricsSnapshot& snapshot) {
  nlohmann::ordered_json json;
  const double seconds = std::max(snapshot.seconds, 1e-9);
  json["seconds"] = snapshot.seconds;
  for (const auto& [name, stage] : snapshot.stages) {
    json["stages"][name] = {{"frames", stage.frames},
                            {"frames_per_second", static_cast<double>(stage.frames) / seconds},
                            {"busy_fraction", stage.busy_s / seconds},
                            {"dropped", stage.dropped}};
  }
  json["counts"] = snapshot.counts;
  json["devices"] = snapshot.devices;
  json["latency_s"] = {{"p50", snapshot.latency_p50_s}, {"p99", snapshot.latency_p99_s}};
  // A device's name, or what a tracker has read, need not be UTF-8.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace previz::pipeline
