// Counts what the pipeline does: frames and time per stage, what waits in front of it, every drop
// with its cause, latency to display. Intake and DeviceCounts add what channels and devices know.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "drivers/device.hpp"

namespace previz::pipeline {

struct StageMetrics {
  std::uint64_t frames = 0;
  double busy_s = 0;                             // time spent working, not waiting
  std::map<std::string, std::uint64_t> dropped;  // cause -> frames
  Waiting waiting;                               // in front of the stage
};

// A pass of the graphics device.
struct PassMetrics {
  std::uint64_t runs = 0;
  double busy_s = 0;  // by the device's own clock
};

// How far the model of what is real is from the edges of the camera's picture, as fit::Figure says.
struct ModelFit {
  struct All {
    double median_px = 0;  // >= 0
    double most_px = 0;    // 90 % of the edges are nearer
    double shift_px = 0;   // of the whole model
  };
  std::optional<All> all;  // absent: the last picture shows too few edges
  // Things that are off while the rest fits, by name, and by how much, px; the worst first.
  std::vector<std::pair<std::string, double>> things_off;
};

struct MetricsSnapshot {
  double seconds = 0;  // since the start
  std::map<std::string, StageMetrics> stages;
  std::map<std::string, std::uint64_t> counts;    // events that are no drops: "pose lost"
  std::map<std::string, DeviceCounters> devices;  // the drivers' own counters, by device
  std::map<std::string, PassMetrics> passes;      // by name; empty: the device does not time them
  double latency_p50_s = 0;  // capture to display, over the last frames; 0: none was shown
  double latency_p99_s = 0;
  std::optional<ModelFit> model_fit;  // absent: not measured now, or too few edges were found
};

// Every stage's thread may use it.
class Metrics {
 public:
  void worked(const std::string& stage, double seconds);
  // Adds time to a stage whose frames worked() counts.
  void busy(const std::string& stage, double seconds);
  // Causes and events are few: beyond most_names of them, those with new names are counted together
  // as `other_names`, so that no text of foreign origin fills the memory.
  void dropped(const std::string& stage, const std::string& cause, std::uint64_t frames = 1);
  void count(const std::string& event, std::uint64_t times = 1);
  // Adds what the device has counted since the last call for this device.
  void device_counted(const std::string& device, const DeviceCounters& more);
  // Adds how long the passes of the device have taken since the last call. Those that were too many
  // to be timed are counted as an event, `untimed_passes`.
  void passes_ran(const render::DeviceTimes& times);
  void shown(double latency_s);
  void model_fit(const std::optional<ModelFit>& fit);  // the last one

  // While it lives, every snapshot asks a queue what waits in it.
  class [[nodiscard]] Watch {
   public:
    Watch(Metrics& metrics, std::string stage, std::function<Waiting()> waiting);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

   private:
    friend class Metrics;
    Metrics& metrics_;
    const std::string stage_;
    const std::function<Waiting()> waiting_;  // from any thread; must not count anything
  };

  // `seconds` is the time since the start, by the caller's clock.
  MetricsSnapshot snapshot(double seconds) const;

  static constexpr std::size_t most_names = 256;
  static constexpr const char* other_names = "others";
  static constexpr const char* untimed_passes = "passes not timed";

 private:
  static constexpr std::size_t latency_window = 4096;  // frames

  mutable std::mutex mutex_;
  std::map<std::string, StageMetrics> stages_;
  std::map<std::string, std::uint64_t> counts_;
  std::map<std::string, DeviceCounters> devices_;
  std::map<std::string, PassMetrics> passes_;
  std::optional<ModelFit> model_fit_;
  std::vector<double> latencies_s_;  // a ring once full
  std::size_t next_latency_ = 0;
  mutable std::mutex watched_mutex_;  // the owners' locks come after it, mutex_ after those
  std::set<const Watch*> watched_;
};

// Puts what waits in a channel, and what it dropped, into the metrics of the stage that reads it.
template <class T>
class Intake {
 public:
  // The metrics and the channel must outlive this object.
  Intake(Metrics& metrics, const std::string& stage, const Channel<T>& channel)
      : metrics_(metrics),
        stage_(stage),
        channel_(channel),
        watch_(metrics, stage, [&channel] { return channel.waiting(); }) {}

  // Counts what was dropped since the last call.
  void update() {
    const std::uint64_t dropped = channel_.dropped();
    metrics_.dropped(stage_, "newer frame", dropped - std::exchange(counted_, dropped));
  }

 private:
  Metrics& metrics_;
  const std::string stage_;
  const Channel<T>& channel_;
  std::uint64_t counted_ = 0;
  const Metrics::Watch watch_;
};

// Adds a device's own counters to the metrics. The metrics outlive the device, which is opened anew
// with every set that is loaded and then counts from 0; only the increase since the last call is
// added.
class DeviceCounts {
 public:
  DeviceCounts(Metrics& metrics, std::string device)
      : metrics_(metrics), device_(std::move(device)) {}

  void update(const DeviceCounters& totals) {
    DeviceCounters more;
    for (const auto& [what, total] : totals) more[what] = total - counted_[what];
    metrics_.device_counted(device_, more);
    counted_ = totals;
  }

 private:
  Metrics& metrics_;
  std::string device_;
  DeviceCounters counted_;
};

// {"seconds": ..., "stages": {"render": {"frames": ..., "frames_per_second": ...,
//  "busy_fraction": ..., "waiting": {"values": ..., "oldest_s": ..., "bytes": ...},
//  "dropped": {"newer frame": ...}}}, "counts": {...},
//  "devices": {"observer": {"lost": ..., "stream missing packets": ...}},
//  "passes": {"extend": {"runs": ..., "busy_s": ...}}, "latency_s": {"p50": ..., "p99": ...},
//  "model_fit_px": {"median": ..., "of_90_percent": ..., "shift": ...,
//                   "things_off": [{"name": ..., "shift": ...}]}}; the last is null if absent, and
// its three numbers are if the last picture gives none
std::string to_json(const MetricsSnapshot& snapshot);

// Returns the smallest value that at least `fraction` (0..1) of the values do not exceed; 0 if
// there are no values.
double quantile(std::vector<double> values, double fraction);

}  // namespace previz::pipeline
