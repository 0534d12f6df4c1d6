#include "daemon/rig/live_pipeline.hpp"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "daemon/output/shown_frame.hpp"
#include "daemon/pipeline/animation_clock.hpp"
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

// From one attempt to open a lost device to the next.
constexpr std::chrono::milliseconds device_patience{500};
constexpr const char* crews_device = "graphics device";

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
  record.carriers = shot.motion.carriers;
  if (shot.light) record.captured_light = shot.light->record;
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
  void make_render_stage();
  void make_render_stage_anyhow();
  bool renew_device(const render::DeviceLost& lost);
  LightPtr estimate(std::vector<pipeline::LightFrame> frames,
                    const std::optional<pipeline::ObserverView>& view);
  LightPtr light_of(const Shot& shot, set::LightMode mode);
  std::optional<Shot> capture();
  Shot track(Shot shot);
  void tell_of_carriers(const Shot& shot);
  void show(Shot shot);
  void record_shown(const Shot& shot);
  CameraSource source(std::stop_token stop, Camera& camera, const set::CameraWish& wish,
                      const char* stage, const char* crews_name,
                      std::function<void(bool)> presence);

  Parts parts;
  std::stop_source stop_source, light_stop;
  std::stop_callback<std::function<void()>> stop_from_outside;
  std::stop_callback<std::function<void()>> stop_light{stop_source.get_token(),
                                                       [this] { light_stop.request_stop(); }};
  const ObserverCalibration calibration;
  pipeline::TrackStage track_stage;
  pipeline::AnimationClock animation_clock;
  pipeline::LightStage lighting;
  pipeline::LightFeed light_feed;
  LightPtr light;  // the last estimate
  LiveRender live_render;
  std::optional<pipeline::RenderStage> render_stage;
  std::optional<CameraSource> observer;
  std::uint64_t next_index = 0;
  std::uint64_t shown_frames = 0;
  int exposure_steps = 0;  // of Look::exposure_steps, done

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
      track_stage(parts.set, calibration, parts.cameras.recorded.track, 0, parts.cameras.lap_ns),
      lighting(parts.set, pipeline::light_calibration(parts.set, parts.cameras.recorded.info),
               calibration),
      live_render(parts.set, parts.look, parts.inbox, parts.metrics, {tracked, reviewed, snapshots},
                  stop_source.get_token()) {
  if (lighting.needs_frames() && !parts.cameras.light)
    throw Error(parts.set.file.string() +
                ": lighting: the set has neither a light camera nor lighting.environment");
  make_render_stage_anyhow();
  stages.emplace(parts.metrics, stop_source.get_token(), [this] { stop_source.request_stop(); });
  if (parts.cameras.light) light_stages();
  observer_stages();
  output_stages();
  waiter = std::jthread([this] {
    try {
      stages->wait();
    } catch (...) {
      failure = std::current_exception();
    }
    live_render.tell_dropped();
    if (tracked.try_pop()) parts.metrics.dropped("render", "stopped");
    parts.inbox.finish();
  });
}

void LivePipeline::Impl::make_render_stage() {
  render_stage.emplace(
      parts.device, parts.set, calibration, parts.scene,
      pipeline::RenderStageOptions{.scale = parts.set.quality.scale,
                                   .cancelled = [this] { return live_render.interrupted(); },
                                   .progress = {},
                                   .note = [this](const std::string& what) { parts.note(what); }});
  live_render.use(*render_stage);
}

// A set may be read again while the device is lost.
void LivePipeline::Impl::make_render_stage_anyhow() {
  try {
    if (!render::is_open(*parts.device)) render::reopen_device(*parts.device);
    make_render_stage();
  } catch (const render::DeviceLost& lost) {
    if (!renew_device(lost)) throw;
  }
}

// On the render thread: nobody else waits for it, and frames go on into the recorder.
bool LivePipeline::Impl::renew_device(const render::DeviceLost& lost) {
  parts.note.again(std::string(lost.what()) + "; it is opened again");
  parts.faults.tell(crews_device, "is lost; it is opened again");
  parts.metrics.count("device lost");
  render_stage.reset();
  while (!stop_source.stop_requested()) {
    try {
      render::reopen_device(*parts.device);
      make_render_stage();
      parts.faults.well(crews_device);
      parts.metrics.count("device opened again");
      parts.note.again("pictures again, on " + render::device_name(*parts.device));
      return true;
    } catch (const std::exception& error) {
      parts.note(error.what());
      render_stage.reset();
      std::this_thread::sleep_for(device_patience);
    }
  }
  return false;
}

CameraSource LivePipeline::Impl::source(std::stop_token stop, Camera& camera,
                                        const set::CameraWish& wish, const char* stage,
                                        const char* crews_name,
                                        std::function<void(bool)> presence) {
  return {camera,
          stage,
          crews_name,
          {std::move(stop), parts.note, parts.metrics, parts.faults, wish.stall_timeout_s,
           std::move(presence)}};
}

void LivePipeline::Impl::light_stages() {
  light_feed.start(
      *stages,
      [this,
       camera = source(light_stop.get_token(), *parts.cameras.light, parts.set.light_camera.camera,
                       "light camera", "light camera", {}),
       index = std::uint64_t{0}]() mutable -> std::optional<pipeline::LightFrame> {
        FramePtr frame = camera.next();
        if (!frame) return std::nullopt;
        if (parts.look.get()->state.mode != Mode::standby) parts.recorder.offer(frame);
        return pipeline::LightFrame{demosaiced(frame), index++};
      },
      [this](std::vector<pipeline::LightFrame> frames,
             const std::optional<pipeline::ObserverView>& view) {
        return estimate(std::move(frames), view);
      });
}

// While tracking rests, the light stays as it was.
LightPtr LivePipeline::Impl::estimate(std::vector<pipeline::LightFrame> frames,
                                      const std::optional<pipeline::ObserverView>& view) {
  if (!lighting.needs_frames()) return nullptr;  // they are there to be recorded
  if (view) lighting.see_observer(*view->frame, view->world_from_camera);
  for (pipeline::LightFrame& waited : frames) lighting.see(std::move(waited.frame), waited.index);
  for (const std::string& trouble : lighting.troubles()) {
    parts.note("light: " + trouble);
    parts.metrics.dropped("lighting", "not usable");
    parts.faults.pass("light", trouble);
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
  observer.emplace(source(stop_source.get_token(), *parts.cameras.observer,
                          parts.set.observer.camera, "observer", "film camera", [this](bool lost) {
                            parts.inbox.post(lost ? Event::camera_lost : Event::camera_back);
                          }));
  stages->source("observer", seen, [this] { return capture(); });
  stages->stage("tracking", seen, tracked, [this](Shot shot) { return track(std::move(shot)); });
  stages->source("picture", rendered, [this] {
    std::optional<Shot> shot =
        live_render.next([this](const render::DeviceLost& lost) { return renew_device(lost); });
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
  if (!shot.frame) {
    light_stop.request_stop();  // a light camera alone has nothing to light
    return std::nullopt;
  }
  shot.index = next_index++;
  shot.arrived = std::chrono::steady_clock::now();
  if (parts.look.get()->state.mode != Mode::standby) parts.recorder.offer(shot.frame);
  shot.frame = demosaiced(shot.frame);  // once, for all that follow
  return shot;
}

void LivePipeline::Impl::tell_of_carriers(const Shot& shot) {
  for (const std::string& trouble : track_stage.troubles()) {
    parts.note(trouble);
    parts.metrics.count("carrier not found");
  }
  for (const set::Carrier& carrier : parts.set.tracking.carriers) {
    const auto where = shot.motion.carriers.find(carrier.name);
    if (where != shot.motion.carriers.end() && !where->second.tags.empty())
      parts.faults.well(carrier.name);
    else
      parts.faults.tell(carrier.name, "is not in the picture");
  }
}

LightPtr LivePipeline::Impl::light_of(const Shot& shot, set::LightMode mode) {
  if (lighting.needs_frames()) return light_feed.newest();
  lighting.use(mode);
  for (const std::string& trouble : lighting.troubles()) parts.note("light: " + trouble);
  return lighting.light_for(shot);
}

Shot LivePipeline::Impl::track(Shot shot) {
  const std::shared_ptr<const Look> look = parts.look.get();
  const double animation_s =
      animation_clock.at(shot.frame->timestamp_ns, look->plays, look->animations_held);
  if (!tracks(look->state)) return shot;
  track_stage(shot);
  shot.motion.animation_s = animation_s;
  tell_of_carriers(shot);
  shot.light = light_of(shot, look->light_mode);
  if (lighting.needs_observer() && shot.track.pose)
    light_feed.see_observer({shot.frame, shot.track.pose->world_from_camera});
  shot.scene = pipeline::scene_state(parts.set, look->edits, shot.motion);
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
  record_shown(shot);
  parts.show(std::move(shot));
}

// A review shows another take.
void LivePipeline::Impl::record_shown(const Shot& shot) {
  const State state = parts.look.get()->state;
  if (!parts.set.recording.composite || !state.recording || state.mode == Mode::review) return;
  const PinholeIntrinsics& whole = calibration.intrinsics;
  parts.recorder.offer_shown(std::make_shared<Frame>(output::shown_frame(
      shot.picture, whole.width, whole.height, shown_frames++, shot.frame->timestamp_ns)));
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
