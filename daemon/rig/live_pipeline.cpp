#include "daemon/rig/live_pipeline.hpp"

#include <optional>
#include <thread>
#include <utility>

#include "daemon/pipeline/edits.hpp"
#include "daemon/pipeline/light_feed.hpp"
#include "daemon/pipeline/light_stage.hpp"
#include "daemon/pipeline/render_stage.hpp"
#include "daemon/pipeline/stages.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/pipeline/track_stage.hpp"
#include "daemon/rig/camera_source.hpp"
#include "daemon/rig/live_render.hpp"
#include "daemon/rig/snapshots.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

using pipeline::LightPtr;
using pipeline::Shot;

namespace {

session::TrackRecord record_of(const Shot& shot) {
  session::TrackRecord record;
  record.timestamp_ns = shot.frame->timestamp_ns;
  record.tracked = shot.track.pose.has_value();
  if (shot.track.pose) {
    record.world_from_camera = shot.track.pose->world_from_camera;
    record.covariance = shot.track.pose->covariance;
    record.tags = shot.track.pose->tags;
  }
  record.scene = shot.scene;
  return record;
}

// Refining and standby let tracking and light estimation rest (P7), except that a take gets its
// poses whatever is shown.
bool tracks(const State& state) {
  return state.recording || state.mode == Mode::live;
}

}  // namespace

struct LivePipeline::Impl {
  Impl(Parts the_parts, std::stop_token stop);

  void light_stages();
  void observer_stages();
  void output_stages();
  LightPtr estimate(std::vector<pipeline::LightFrame> frames,
                    const std::optional<pipeline::ObserverView>& view);
  std::optional<Shot> capture();
  Shot track(Shot shot);
  void show(Shot shot);
  CameraSource source(Camera& camera, const char* stage, std::function<void(bool)> presence);

  Parts parts;
  std::stop_source stop_source;
  std::stop_callback<std::function<void()>> stop_from_outside;
  const ObserverCalibration calibration;
  pipeline::TrackStage track_stage;
  pipeline::LightStage lighting;
  pipeline::LightFeed light_feed;
  LightPtr light;  // the last estimate
  LiveRender live_render;
  pipeline::RenderStage render_stage;
  std::optional<CameraSource> observer;
  std::uint64_t next_index = 0;
  set::LightMode light_mode = parts.set.lighting.mode;  // of an environment file
  int exposure_steps = 0;                               // of Look::exposure_steps, done

  pipeline::Mailbox<Shot> seen, tracked, reviewed, rendered;
  pipeline::BoundedQueue<Shot> snapshots{4};  // ends with the render thread, or at a stop
  std::stop_callback<std::function<void()>> close_snapshots{stop_source.get_token(),
                                                            [this] { snapshots.close(); }};
  std::exception_ptr failure;
  std::optional<pipeline::StageThreads> stages;
  std::jthread waiter;
};

LivePipeline::Impl::Impl(Parts the_parts, std::stop_token stop)
    : parts(std::move(the_parts)),
      stop_from_outside(std::move(stop), [this] { stop_source.request_stop(); }),
      calibration(pipeline::observer_calibration(parts.set, parts.cameras.recorded.info)),
      track_stage(parts.set, calibration, parts.cameras.recorded.track, parts.cameras.lap_ns),
      lighting(parts.set, pipeline::light_calibration(parts.set, parts.cameras.recorded.info),
               calibration),
      light_feed(parts.cameras.light ? nullptr : lighting.light()),
      live_render(parts.set, parts.look, parts.inbox, parts.metrics,
                  {tracked, reviewed, light_feed, snapshots}, stop_source.get_token()),
      render_stage(parts.device, parts.set, calibration, parts.scene,
                   {.scale = parts.set.quality.scale,
                    .cancelled = [this] { return live_render.interrupted(); },
                    .progress = {},
                    .note = [this](const std::string& what) { parts.note(what); }}) {
  if (lighting.needs_frames() && !parts.cameras.light)
    throw Error(parts.set.file.string() +
                ": lighting: the set has neither a light camera nor lighting.environment");
  live_render.use(render_stage);
  stages.emplace(parts.metrics, stop_source.get_token());
  if (parts.cameras.light) light_stages();
  observer_stages();
  output_stages();
  waiter = std::jthread([this] {
    try {
      stages->wait();
    } catch (...) {
      failure = std::current_exception();
    }
    parts.metrics.dropped("render", "newer frame", tracked.dropped());
    if (tracked.try_pop()) parts.metrics.dropped("render", "stopped");
    parts.inbox.finish();
  });
}

CameraSource LivePipeline::Impl::source(Camera& camera, const char* stage,
                                        std::function<void(bool)> presence) {
  return {camera, stage, {stop_source.get_token(), parts.note, parts.metrics, std::move(presence)}};
}

void LivePipeline::Impl::light_stages() {
  light_feed.start(
      *stages,
      [this, camera = source(*parts.cameras.light, "light camera", {}),
       index = std::uint64_t{0}]() mutable -> std::optional<pipeline::LightFrame> {
        FramePtr frame = camera.next();
        if (!frame) return std::nullopt;
        if (parts.look.get()->state.mode != Mode::standby) parts.recorder.offer(frame);
        return pipeline::LightFrame{std::move(frame), index++};
      },
      [this](std::vector<pipeline::LightFrame> frames,
             const std::optional<pipeline::ObserverView>& view) {
        return estimate(std::move(frames), view);
      });
}

// While tracking rests, the light stays as it was.
LightPtr LivePipeline::Impl::estimate(std::vector<pipeline::LightFrame> frames,
                                      const std::optional<pipeline::ObserverView>& view) {
  if (view) lighting.see_observer(*view->frame, view->world_from_camera);
  for (pipeline::LightFrame& waited : frames) lighting.see(std::move(waited.frame), waited.index);
  for (const std::string& trouble : lighting.troubles()) {
    parts.note("light: " + trouble);
    parts.metrics.dropped("lighting", "not usable");
  }
  const std::shared_ptr<const Look> look = parts.look.get();
  if (!tracks(look->state)) return light;
  lighting.use(look->light_mode);
  light = lighting.light();
  if (light)
    for (const std::string& what : light->lighting.report.notes) parts.note("light: " + what);
  return light;
}

void LivePipeline::Impl::observer_stages() {
  observer.emplace(source(*parts.cameras.observer, "observer", [this](bool lost) {
    parts.inbox.post(lost ? Event::camera_lost : Event::camera_back);
  }));
  stages->source("observer", seen, [this] { return capture(); });
  stages->stage("tracking", seen, tracked, [this](Shot shot) { return track(std::move(shot)); });
  stages->source("picture", rendered, [this] {
    std::optional<Shot> shot = live_render.next();
    if (!shot) snapshots.close();
    return shot;
  });
}

std::optional<Shot> LivePipeline::Impl::capture() {
  const int wanted = parts.look.get()->exposure_steps;
  if (wanted != exposure_steps)
    observer->change_exposure((wanted - exposure_steps) * parts.set.control.exposure_step_stops);
  exposure_steps = wanted;

  Shot shot;
  shot.frame = observer->next();
  if (!shot.frame) return std::nullopt;
  shot.index = next_index++;
  shot.arrived = std::chrono::steady_clock::now();
  if (parts.look.get()->state.mode != Mode::standby) parts.recorder.offer(shot.frame);
  return shot;
}

Shot LivePipeline::Impl::track(Shot shot) {
  const std::shared_ptr<const Look> look = parts.look.get();
  if (!tracks(look->state)) return shot;
  if (!lighting.needs_frames() && look->light_mode != light_mode) {
    light_mode = look->light_mode;
    lighting.use(light_mode);
    light_feed.put(lighting.light());
  }
  track_stage(shot);
  if (lighting.needs_observer() && shot.track.pose)
    light_feed.see_observer({shot.frame, shot.track.pose->world_from_camera});
  shot.scene = pipeline::scene_state(parts.set, look->edits);
  parts.recorder.offer(record_of(shot));
  return shot;
}

void LivePipeline::Impl::output_stages() {
  stages->sink("display", rendered, [this](Shot shot) { show(std::move(shot)); });
  set::Set set = parts.set;
  set.observer.calibration = calibration;
  stages->sink("snapshot", snapshots, [this, set = std::move(set)](const Shot& shot) {
    try {
      parts.note.again("snapshot: " + write_snapshot(shot, set).string());
    } catch (const Error& error) {
      parts.note.again(std::string("snapshot: ") + error.what());
    }
  });
}

void LivePipeline::Impl::show(Shot shot) {
  if (!shot.whole) return parts.metrics.dropped("display", "stopped while rendering");
  if (!shot.untouched.empty()) {
    parts.metrics.count("plate untouched: " + shot.untouched);
    parts.note("plate untouched: " + shot.untouched);
  }
  const render::Counters& counters = shot.counters;
  if (counters.dropped_not_finite + counters.dropped_negative + counters.stopped_in_layers > 0) {
    parts.metrics.count("samples not finite", counters.dropped_not_finite);
    parts.metrics.count("samples negative", counters.dropped_negative);
    parts.metrics.count("rays stopped by the last of too many transparent surfaces",
                        counters.stopped_in_layers);
  }
  parts.show(std::move(shot));
}

LivePipeline::LivePipeline(Parts parts, std::stop_token stop)
    : impl_(std::make_unique<Impl>(std::move(parts), std::move(stop))) {}

LivePipeline::~LivePipeline() {
  impl_->stop_source.request_stop();
}

void LivePipeline::wait() {
  if (impl_->waiter.joinable()) impl_->waiter.join();
  if (impl_->failure) std::rethrow_exception(std::exchange(impl_->failure, nullptr));
}

pipeline::Mailbox<Shot>& LivePipeline::reviewed() {
  return impl_->reviewed;
}

}  // namespace previz::rig
