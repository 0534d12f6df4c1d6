#include "daemon/core/pipeline/take_shots.hpp"

#include <chrono>
#include <string>
#include <utility>
#include <variant>

#include "daemon/core/session/replay_camera.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

set::Set lit(set::Set set, const TakeShotsOptions& options) {
  if (options.lighting) set.lighting = *options.lighting;
  if (!options.whole_light) return set;
  set.captured_lamps.clear();
  for (set::Light& light : set.lights) light.captured = light.measured = false;
  return set;
}

}  // namespace

TakeShots::TakeShots(const Take& take, TakeShotsOptions options)
    : options_(std::move(options)),
      track_(take),
      light_(lit(take.set, options_), take.light, take.observer,
             options_.whole_light ? nullptr : options_.scene),
      light_stream_(take.light_stream) {
  if (light_.needs_frames() && !light_stream_)
    throw Error(take.session.directory.string() + ": " + no_light_words());
  const std::size_t frames = take.observer_stream->records().size();
  if (options_.first >= frames)
    throw Error(take.session.directory.string() + ": has no frame " +
                std::to_string(options_.first) + ", only " + std::to_string(frames) + " frames");
  goes_through_all_ = options_.from_start && (track_.remembers() || light_.remembers());
  next_ = goes_through_all_ ? 0 : options_.first;
  ReplayOptions replayed;
  replayed.speed = options_.speed;
  replayed.first = next_;
  replayed.last = options_.last;
  camera_ = replay(take.observer_stream, "observer", replayed);
  camera_->start();
}

std::optional<Shot> TakeShots::next() {
  while (!options_.stop.stop_requested()) {
    CameraEvent event = camera_->next(std::chrono::milliseconds(100));
    if (std::holds_alternative<EndOfStream>(event)) return std::nullopt;
    if (std::holds_alternative<NoFrame>(event)) continue;
    const std::uint64_t index = next_++;
    if (const auto* what = std::get_if<DeviceTrouble>(&event)) {
      if (options_.note) options_.note(what->device + ": " + what->what);
      if (options_.metrics) options_.metrics->dropped("observer", "device trouble");
      if (options_.unreadable && index >= options_.first) options_.unreadable(index);
      continue;
    }
    const bool wanted = index >= options_.first && (!options_.wanted || options_.wanted(index));
    if (!wanted && !goes_through_all_) continue;
    Shot shot;
    shot.index = index;
    shot.frame = std::get<FramePtr>(std::move(event));
    shot.arrived = std::chrono::steady_clock::now();
    track(shot);
    if (wanted || light_.remembers()) light(shot);
    if (wanted) return shot;
  }
  return std::nullopt;
}

void TakeShots::track(Shot& shot) {
  const auto begin = std::chrono::steady_clock::now();
  track_(shot);
  for (const std::string& what : track_.troubles()) {
    if (options_.metrics) options_.metrics->count("carrier not found");
    trouble(what);
  }
  count_work("tracking", begin);
}

// The light comes from the light frames up to the time of the shot's frame.
void TakeShots::light(Shot& shot) {
  const auto begin = std::chrono::steady_clock::now();
  while (light_.needs_frames() && next_light_ < light_stream_->records().size() &&
         light_stream_->records()[next_light_].timestamp_ns <= shot.frame->timestamp_ns) {
    light_.see(light_stream_->read(next_light_), next_light_);
    ++next_light_;
  }
  if (light_.needs_observer() && shot.track.pose)
    light_.see_observer(*plate_of(shot), shot.frame->exposure, shot.track.pose->world_from_camera);
  shot.light = light_.light_for(shot);
  for (const std::string& what : light_.troubles()) {
    if (options_.metrics) options_.metrics->dropped("lighting", "not usable");
    trouble("light: " + what);
  }
  count_work("lighting", begin);
}

void TakeShots::trouble(const std::string& words) {
  if (options_.note && noted_.is_first(report::wording(words))) options_.note(words);
}

void TakeShots::count_work(const char* stage, std::chrono::steady_clock::time_point begin) {
  if (!options_.metrics) return;
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  options_.metrics->worked(stage, spent.count());
}

}  // namespace previz::pipeline
