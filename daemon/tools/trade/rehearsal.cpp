#include "daemon/tools/trade/rehearsal.hpp"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/live/inbox.hpp"
#include "daemon/core/live/live_pipeline.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/liveness.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::trade {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double settling_share = 1.0 / 3;
constexpr std::size_t least_pictures = 3;
// Until the first picture, a device may compile its programs: so many times the rehearsal.
constexpr double first_picture_patience = 2;
constexpr std::chrono::milliseconds look_delay{20};

// The set with the take in the place of its cameras, without what a rehearsal must not touch. A
// take without light is lit by what the set replays.
set::Set on_take(set::Set set, const std::filesystem::path& take) {
  set.observer.driver = set::replay_driver;
  set.observer.device = take.string();
  set.observer.faults.clear();
  if (std::filesystem::exists(take / "light.mkv") ||
      set.light_camera.driver != set::replay_driver || set.light_camera.device.empty()) {
    set.light_camera.driver = set::replay_driver;
    set.light_camera.device = take.string();
  }
  set.light_camera.faults.clear();
  set.buttons = {};
  return set;
}

output::RecorderOptions idle_recorder(const set::Set& set) {
  output::RecorderOptions options;
  options.take.folders = {set.recording.directory};
  options.preroll_s = set.recording.preroll_s;
  options.queue_bytes = output::queue_bytes({});
  return options;
}

// The pictures that were shown: when, and what each took to render.
class Shown {
 public:
  void add(const pipeline::Shot& shot) {
    if (!shot.untouched.empty()) return;
    const std::lock_guard lock(mutex_);
    pictures_.push_back({Clock::now(), shot.render_s});
  }
  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return pictures_.size();
  }
  Rehearsal since(std::size_t first) const {
    const std::lock_guard lock(mutex_);
    Rehearsal found;
    if (pictures_.size() < first + least_pictures) return found;
    std::vector<double> times;
    for (std::size_t i = first; i < pictures_.size(); ++i) times.push_back(pictures_[i].render_s);
    const std::chrono::duration<double> span = pictures_.back().when - pictures_[first].when;
    found.fps = static_cast<double>(times.size() - 1) / span.count();
    found.frame_s = pipeline::quantile(std::move(times), 0.5);
    return found;
  }

 private:
  struct Picture {
    Clock::time_point when;
    double render_s;
  };
  mutable std::mutex mutex_;
  std::vector<Picture> pictures_;
};

// The first error that a stage reports: why nothing was shown.
class FirstFailure {
 public:
  void hear(const report::Report& report) {
    const std::lock_guard lock(mutex_);
    if (words_.empty() && report.severity == report::Severity::error) words_ = report.text;
  }
  std::string words() const {
    const std::lock_guard lock(mutex_);
    return words_;
  }

 private:
  mutable std::mutex mutex_;
  std::string words_;
};

}  // namespace

Rehearsal rehearse(const std::shared_ptr<render::Device>& device, const set::Set& set,
                   const scene::Scene& scene, const std::filesystem::path& take, double seconds,
                   const std::stop_token& stop) {
  const set::Set played = on_take(set, take);
  FirstFailure failure;  // Reports calls it on one thread at a time
  report::Reports reports([&](const report::Report& report) { failure.hear(report); });
  pipeline::Metrics metrics;
  pipeline::Liveness liveness;
  live::Cameras cameras = live::open_cameras(played, true);
  pipeline::Newest<live::Look> look(live::first_look(played));
  live::Inbox inbox;
  output::Recorder recorder(idle_recorder(played));
  std::shared_ptr<render::Renderer> renderer;
  Shown shown;
  live::LivePipeline pipeline(
      {.set = played,
       .cameras = cameras,
       .scene = scene,
       .device = device,
       .renderer = renderer,
       .recorder = recorder,
       .look = look,
       .inbox = inbox,
       .kept = {.reports = reports, .metrics = metrics, .liveness = liveness},
       .show = [&](const pipeline::Shot& shot) { shown.add(shot); }},
      stop);
  const auto wait_until = [&](Clock::time_point end) {
    while (Clock::now() < end && !stop.stop_requested() && !inbox.finished())
      std::this_thread::sleep_for(look_delay);
  };
  const auto latest =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(
                         std::chrono::duration<double>(first_picture_patience * seconds));
  while (shown.count() == 0 && Clock::now() < latest && !stop.stop_requested() && !inbox.finished())
    std::this_thread::sleep_for(look_delay);
  const auto begin = Clock::now();
  const auto in = [&](double s) {
    return begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
  };
  wait_until(in(settling_share * seconds));
  const std::size_t settled = shown.count();
  wait_until(in(seconds));
  Rehearsal found = shown.since(settled);
  if (found.fps == 0) found.why_not = failure.words();
  const set::PreviewStep step = pipeline.governed();
  found.making = {std::max(step.samples, 1), step.scale,
                  step.denoise.value_or(played.quality.denoise)};
  return found;
}

}  // namespace previz::trade
