#include "daemon/core/pipeline/metrics.hpp"

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

void Metrics::model_fit(const std::optional<ModelFit>& fit) {
  const std::lock_guard lock(mutex_);
  model_fit_ = fit;
}

void Metrics::passes_ran(const render::DeviceTimes& times) {
  const std::lock_guard lock(mutex_);
  for (const render::DeviceTimes::Pass& pass : times.passes) {
    PassMetrics& all = passes_[pass.name];
    all.runs += pass.count;
    all.busy_s += 1e-3 * pass.ms;
  }
  if (times.untimed > 0) count_named(counts_, untimed_passes) += times.untimed;
}

Metrics::Watch::Watch(Metrics& metrics, std::string stage, std::function<Waiting()> waiting)
    : metrics_(metrics), stage_(std::move(stage)), waiting_(std::move(waiting)) {
  const std::lock_guard lock(metrics_.watched_mutex_);
  metrics_.watched_.insert(this);
}

Metrics::Watch::~Watch() {
  const std::lock_guard lock(metrics_.watched_mutex_);
  metrics_.watched_.erase(this);
}

MetricsSnapshot Metrics::snapshot(double seconds) const {
  MetricsSnapshot snapshot;
  snapshot.seconds = seconds;
  {
    const std::lock_guard lock(mutex_);
    snapshot.stages = stages_;
    snapshot.counts = counts_;
    snapshot.devices = devices_;
    snapshot.passes = passes_;
    snapshot.model_fit = model_fit_;
    snapshot.latency_p50_s = quantile(latencies_s_, 0.50);
    snapshot.latency_p99_s = quantile(latencies_s_, 0.99);
  }
  const std::lock_guard lock(watched_mutex_);
  for (const Watch* watch : watched_) {
    const Waiting more = watch->waiting_();
    Waiting& all = snapshot.stages[watch->stage_].waiting;
    all.values += more.values;
    all.bytes += more.bytes;
    all.oldest_s = std::max(all.oldest_s, more.oldest_s);
  }
  return snapshot;
}

std::string to_json(const MetricsSnapshot& snapshot) {
  nlohmann::ordered_json json;
  const double seconds = std::max(snapshot.seconds, 1e-9);
  json["seconds"] = snapshot.seconds;
  for (const auto& [name, stage] : snapshot.stages) {
    json["stages"][name] = {{"frames", stage.frames},
                            {"frames_per_second", static_cast<double>(stage.frames) / seconds},
                            {"busy_fraction", stage.busy_s / seconds},
                            {"waiting",
                             {{"values", stage.waiting.values},
                              {"oldest_s", stage.waiting.oldest_s},
                              {"bytes", stage.waiting.bytes}}},
                            {"dropped", stage.dropped}};
  }
  json["counts"] = snapshot.counts;
  json["devices"] = snapshot.devices;
  for (const auto& [name, pass] : snapshot.passes)
    json["passes"][name] = {{"runs", pass.runs}, {"busy_s", pass.busy_s}};
  json["latency_s"] = {{"p50", snapshot.latency_p50_s}, {"p99", snapshot.latency_p99_s}};
  json["model_fit_px"] = nullptr;
  if (const std::optional<ModelFit>& fit = snapshot.model_fit) {
    auto& of_model = json["model_fit_px"];
    of_model = {{"median", nullptr}, {"of_90_percent", nullptr}, {"shift", nullptr}};
    if (fit->all)
      of_model = {{"median", fit->all->median_px},
                  {"of_90_percent", fit->all->most_px},
                  {"shift", fit->all->shift_px}};
    of_model["things_off"] = nlohmann::ordered_json::array();
    for (const auto& [name, shift_px] : fit->things_off)
      of_model["things_off"].push_back({{"name", name}, {"shift", shift_px}});
  }
  // A device's name, or what a tracker has read, need not be UTF-8.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace previz::pipeline
