#include "daemon/rig/live_pipeline.hpp"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "daemon/output/shown_frame.hpp"
#include "daemon/pipeline/animation_clock.hpp"
#include "daemon/pipeline/edits.hpp"
#include "daemon/pipeline/render_stage.hpp"
#include "daemon/pipeline/stages.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/pipeline/track_stage.hpp"
#include "daemon/rig/camera_source.hpp"
#include "daemon/rig/gpu_keeper.hpp"
#include "daemon/rig/graphics.hpp"
#include "daemon/rig/live_light.hpp"
#include "daemon/rig/live_render.hpp"
#include "daemon/rig/snapshots.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::rig {

using pipeline::Shot;
using report::Severity;

namespace {

session::TrackRecord track_record_of(const Shot& shot) {
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

}  // namespace

struct LivePipeline::Impl {
  Impl(Parts the_parts, std::stop_token stop);

  void light_stages();
  void observer_stages();
  void output_stages();
  GpuKeeper::Gpu gpu();
  void make_track_stage();
  void make_render_stage();
  void drop_render_stage();
  void begin_rendering_anew();
  void show_plates(std::chrono::milliseconds time);
  std::optional<Shot> capture();
  Shot track(Shot shot);
  void offer_track(Shot& shot, const pipeline::Edits& edits);
  std::optional<Shot> next_picture();
  void report_carriers(const Shot& shot);
  void show(Shot shot);
  void record_shown(const Shot& shot);
  std::unique_ptr<CameraSource> source(std::stop_token stop, Camera& camera,
                                       const set::CameraWish& wish, const char* stage,
                                       const char* crews_name, std::function<void(bool)> presence);
  void record_captured(const FramePtr& frame);

  Parts parts;
  std::stop_source stop_source, light_stop;
  std::stop_callback<std::function<void()>> stop_from_outside;
  std::stop_callback<std::function<void()>> stop_light{stop_source.get_token(),
                                                       [this] { light_stop.request_stop(); }};
  const ObserverCalibration calibration;
  std::optional<pipeline::TrackStage> track_stage;
  std::optional<tracking::PoseFilter> pose_filter;  // absent: the set shows poses as they are found
  pipeline::AnimationClock animation_clock;
  pipeline::Mailbox<Shot> seen, tracked, reviewed, rendered;
  pipeline::Newest<std::vector<pipeline::FoundLamp>> found{{}};
  pipeline::Newest<std::map<std::string, std::string>> recorded_variants{{}};
  pipeline::Newest<set::PreviewStep> governed{{.samples = 0, .denoise = {}}};
  pipeline::BoundedQueue<Shot> snapshots{4};  // closed by the render thread, or at a stop
  std::stop_callback<std::function<void()>> close_snapshots{stop_source.get_token(),
                                                            [this] { snapshots.close(); }};
  LiveLight light;
  LiveRender live_render;
  std::optional<pipeline::RenderStage> render_stage;
  GpuKeeper gpu_keeper;
  int begun_anew = 0;  // renderers since the last picture, beside the first
  // Each belongs to the thread of its stage; tracking has the two in the middle, the display two.
  pipeline::StageKeeper demosaicing{"conversion", parts.kept, &pipeline::Patience::stage};
  pipeline::StageKeeper tracking{"tracking", parts.kept, &pipeline::Patience::stage,
                                 [this] { make_track_stage(); }};
  pipeline::StageKeeper lighting{"picture lighting", parts.kept, &pipeline::Patience::stage};
  pipeline::StageKeeper rendering{"render", parts.kept, &pipeline::Patience::render,
                                  [this] { begin_rendering_anew(); }};
  pipeline::StageKeeper keeping_shown{"composite recording", parts.kept,
                                      &pipeline::Patience::stage};
  pipeline::StageKeeper displaying{"display", parts.kept, &pipeline::Patience::stage};
  std::unique_ptr<CameraSource> observer, light_camera;
  std::uint64_t next_index = 0;
  std::uint64_t shown_frames = 0;
  int exposure_steps = 0;  // steps of Look::exposure_steps done so far

  std::exception_ptr failure;
  std::optional<pipeline::StageThreads> stages;
  std::jthread waiter;
};

LivePipeline::Impl::Impl(Parts the_parts, std::stop_token stop)
    : parts(std::move(the_parts)),
      stop_from_outside(std::move(stop), [this] { stop_source.request_stop(); }),
      calibration(pipeline::observer_calibration(parts.set, parts.cameras.recorded.info)),
      light({parts.set, parts.scene, parts.look, parts.kept},
            pipeline::light_calibration(parts.set, parts.cameras.recorded.info), calibration),
      live_render(parts.set, parts.look, parts.inbox, parts.kept.metrics, parts.kept.reports,
                  {tracked, reviewed, snapshots, found, governed, recorded_variants},
                  stop_source.get_token()),
      gpu_keeper(gpu(), {parts.kept.reports, parts.kept.metrics, stop_source.get_token(),
                         [this](std::chrono::milliseconds time) { show_plates(time); }}) {
  if (light.needs_frames() && !parts.cameras.light)
    throw Error(parts.set.file.string() +
                ": lighting: the set has neither a light camera nor lighting.environment");
  light.await_bracket(parts.cameras.light_exposures);
  make_track_stage();
  gpu_keeper.start();
  stages.emplace(parts.kept.metrics, stop_source.get_token(),
                 [this] { stop_source.request_stop(); });
  if (parts.cameras.light) light_stages();
  observer_stages();
  output_stages();
  waiter = std::jthread([this] {
    try {
      stages->wait();
    } catch (...) {
      failure = std::current_exception();
    }
    live_render.count_dropped();
    if (tracked.try_pop()) parts.kept.metrics.dropped("render", "stopped");
    parts.inbox.finish(failure != nullptr);
  });
}

void LivePipeline::Impl::make_track_stage() {
  const set::Tracking& wish = parts.set.tracking;
  track_stage.emplace(parts.set, calibration, parts.cameras.recorded.track, 0, parts.cameras.lap_ns,
                      wish.search_parts ? tracking::Search::parts : tracking::Search::whole);
  pose_filter.reset();
  if (wish.enabled && (wish.smooth || wish.hold_s > 0))
    pose_filter.emplace(wish, calibration.intrinsics);
}

void LivePipeline::Impl::make_render_stage() {
  render_stage.emplace(parts.device, parts.set, calibration, parts.scene,
                       pipeline::RenderStageOptions{
                           .renderer = std::exchange(parts.renderer, nullptr),
                           .is_live = true,
                           .scale = parts.set.quality.scale,
                           .passes_other_sizes = true,
                           .cancelled = [this] { return live_render.interrupted(); },
                           .progress = {},
                           .note =
                               [this](const std::string& what) {
                                 parts.kept.reports(report::once({Severity::warning, "", what}));
                               }});
  parts.renderer = render_stage->renderer();
  live_render.use(*render_stage);
  let_recording_first();
}

void LivePipeline::Impl::drop_render_stage() {
  live_render.use_none();
  render_stage.reset();
  parts.renderer.reset();
}

// A renderer that fails again is made on a device that was opened anew.
void LivePipeline::Impl::begin_rendering_anew() {
  drop_render_stage();
  if (++begun_anew > 1) gpu().open();
  gpu_keeper.start();
}

GpuKeeper::Gpu LivePipeline::Impl::gpu() {
  return {.is_open = [this] { return render::is_open(*parts.device); },
          .open =
              [this] {
                parts.renderer.reset();  // it is of the device that was lost
                render::reopen_device(*parts.device, parts.set.quality.cpu_instead);
              },
          .name = [this] { return render::drawing_device(*parts.device); },
          .stands_in = [this] { return render::cpu_stands_in(*parts.device); },
          .build = [this] { make_render_stage(); },
          .drop = [this] { drop_render_stage(); }};
}

// While there is no graphics device, the crew sees what the camera sees. Only this may take any
// time: a driver can hang in each attempt to open the device or to make the renderer.
void LivePipeline::Impl::show_plates(std::chrono::milliseconds time) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + time;
  const std::stop_token stop = stop_source.get_token();
  rendering.waits();
  while (!stop.stop_requested() && Clock::now() < end) {
    if (std::optional<Shot> shot = live_render.next_plate("no graphics card"))
      rendered.push(*std::move(shot));
    else if (live_render.finished())
      std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a stop comes soon
  }
  rendering.goes_on();
}

std::unique_ptr<CameraSource> LivePipeline::Impl::source(std::stop_token stop, Camera& camera,
                                                         const set::CameraWish& wish,
                                                         const char* stage, const char* crews_name,
                                                         std::function<void(bool)> presence) {
  return std::make_unique<CameraSource>(
      camera, stage, crews_name,
      CameraSource::Parts{std::move(stop), parts.kept, wish.stall_timeout_s, std::move(presence)});
}

void LivePipeline::Impl::record_captured(const FramePtr& frame) {
  try {
    if (parts.look.get()->state.mode != Mode::standby) parts.recorder.offer(frame);
  } catch (const std::exception& error) {  // there is no memory for it
    parts.kept.metrics.dropped("recorder", "failed");
    parts.kept.reports(report::once({Severity::error, "recorder", reason_of(error)}));
  }
}

void LivePipeline::Impl::light_stages() {
  light_camera = source(light_stop.get_token(), *parts.cameras.light, parts.set.light_camera.camera,
                        "light camera", "light camera", {});
  light.start(*stages, [this] {
    FramePtr frame = light_camera->next();
    if (frame) record_captured(frame);
    return frame;
  });
}

void LivePipeline::Impl::observer_stages() {
  observer = source(stop_source.get_token(), *parts.cameras.observer, parts.set.observer.camera,
                    "observer", "film camera", [this](bool lost) {
                      parts.inbox.post(lost ? Event::camera_lost : Event::camera_back);
                    });
  stages->source("observer", seen, [this] { return capture(); });
  stages->stage("tracking", seen, tracked, [this](Shot shot) { return track(std::move(shot)); });
  stages->source(rendered, [this] {  // LiveRender counts what it renders
    std::optional<Shot> shot = next_picture();
    if (!shot) snapshots.close();
    return shot;
  });
}

// While the renderer is made anew, the crew sees the plate.
std::optional<Shot> LivePipeline::Impl::next_picture() {
  const auto renew = [this](const render::DeviceLost& lost) { return gpu_keeper.renew(lost); };
  for (;;) {
    std::optional<Shot> shot;
    const bool is_well = rendering.attempt([&] {
      if (!gpu_keeper.await()) return rendering.had_nothing_to_do();
      rendering.goes_on();
      shot = live_render.next(renew);
      if (!shot) return rendering.had_nothing_to_do();
      begun_anew = 0;
    });
    if (!is_well) {
      drop_render_stage();
      shot = live_render.next_plate("the renderer has failed");
    }
    if (shot || live_render.finished()) return shot;
  }
}

std::optional<Shot> LivePipeline::Impl::capture() {
  const int wanted = parts.look.get()->exposure_steps;
  if (const int steps = wanted - std::exchange(exposure_steps, wanted); steps != 0)
    observer->change_exposure(steps * parts.set.control.exposure_step_stops);

  while (FramePtr frame = observer->next()) {
    Shot shot;
    shot.index = next_index++;
    shot.arrived = std::chrono::steady_clock::now();
    record_captured(frame);
    if (demosaicing.attempt([&] { shot.frame = demosaiced(frame); })) return shot;  // once for all
    parts.kept.metrics.worked("observer", 0);
    parts.kept.metrics.dropped("tracking", "not converted");
  }
  light_stop.request_stop();  // without the observer there is nothing to light
  return std::nullopt;
}

void LivePipeline::Impl::report_carriers(const Shot& shot) {
  for (const std::string& trouble : track_stage->troubles()) {
    parts.kept.reports(report::once({Severity::warning, "", trouble}));
    parts.kept.metrics.count("carrier not found");
  }
  for (const set::Carrier& carrier : parts.set.tracking.carriers) {
    const auto where = shot.motion.carriers.find(carrier.name);
    if (where != shot.motion.carriers.end() && !where->second.tags.empty())
      parts.kept.reports.settle(carrier.name);
    else
      parts.kept.reports.show(report::lasting(carrier.name, "is not in the picture"));
  }
}

Shot LivePipeline::Impl::track(Shot shot) {
  const std::shared_ptr<const Look> look = parts.look.get();
  const double animation_s =
      animation_clock.at(shot.frame->timestamp_ns, look->plays, look->animations_held);
  if (!tracks(look->state)) {
    parts.kept.metrics.count("frames not tracked in this mode");
    return shot;
  }
  const bool is_tracked = tracking.attempt([&] {
    (*track_stage)(shot);
    report_carriers(shot);
  });
  if (!is_tracked) {
    shot.track = {};
    shot.track.reason = "tracking has failed";
    shot.motion = {};
    shot.tracking_done = true;
  }
  if (pose_filter) shot.shown_pose = pose_filter->shown(shot.track, shot.frame->timestamp_ns);
  if (shot.shown_pose && !shot.track.pose) parts.kept.metrics.count("predicted poses");
  shot.motion.animation_s = animation_s;
  lighting.attempt([&] {
    shot.light = light.light_for(shot, look->light_mode);
    light.see_observer(shot);
  });
  offer_track(shot, look->edits);
  return shot;
}

void LivePipeline::Impl::offer_track(Shot& shot, const pipeline::Edits& edits) {
  try {
    shot.scene = pipeline::scene_state(parts.set, edits, shot.motion);
    parts.recorder.offer(track_record_of(shot));
  } catch (const std::exception& error) {
    parts.kept.metrics.count("tracking lines not recorded");
    parts.kept.reports(report::once({Severity::error, "tracking", reason_of(error)}));
  }
}

void LivePipeline::Impl::output_stages() {
  stages->sink("display", rendered, [this](Shot shot) { show(std::move(shot)); });
  set::Set set = parts.set;
  set.observer.calibration = calibration;
  stages->sink("snapshot", snapshots, [this, set = std::move(set)](const Shot& shot) {
    try {
      parts.kept.reports({Severity::info, "snapshot", write_snapshot(shot, set).string()});
    } catch (const std::exception& error) {
      parts.kept.reports({Severity::error, "snapshot", reason_of(error)});
    }
  });
}

// This runs on the display thread, so that the render thread need not make the recorder's frame of
// each picture.
void LivePipeline::Impl::show(Shot shot) {
  if (!shot.whole) return parts.kept.metrics.dropped("display", "stopped while rendering");
  keeping_shown.attempt([&] { record_shown(shot); });
  const bool is_shown = displaying.attempt([&] {
    count_picture(shot, parts.kept.metrics, parts.kept.reports);
    parts.show(std::move(shot));
  });
  if (!is_shown) parts.kept.metrics.dropped("display", "failed");
}

// A review shows another take than the one that is being recorded.
void LivePipeline::Impl::record_shown(const Shot& shot) {
  const State state = parts.look.get()->state;
  if (!parts.set.recording.composite || !state.recording || state.mode == Mode::review) return;
  const PinholeIntrinsics& whole = calibration.intrinsics;
  parts.recorder.offer_shown(std::make_shared<Frame>(output::shown_frame(
      *shot.picture, whole.width, whole.height, shown_frames++, shot.frame->timestamp_ns)));
}

void count_picture(const Shot& shot, pipeline::Metrics& metrics, report::Reports& reports) {
  if (!shot.untouched.empty()) {
    // Without its figures, such as the numbers of tags, a reason is one of few.
    metrics.count("plate untouched: " + report::wording(shot.untouched));
    reports(report::once({Severity::warning, "plate untouched", shot.untouched}));
  }
  const render::Counters& counters = shot.counters;
  if (counters.rebuilt_trees > 0)
    metrics.count("trees of deforming meshes rebuilt", counters.rebuilt_trees);
  if (counters.dropped_not_finite + counters.dropped_negative + counters.stopped_in_layers +
          counters.unfinished ==
      0)
    return;
  metrics.count("non-finite samples", counters.dropped_not_finite);
  metrics.count("negative samples", counters.dropped_negative);
  metrics.count("rays stopped after too many transparent surfaces", counters.stopped_in_layers);
  metrics.count("paths cut short", counters.unfinished);
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

std::vector<pipeline::FoundLamp> LivePipeline::found_lamps() const {
  return *impl_->found.get();
}

set::PreviewStep LivePipeline::governed() const {
  return *impl_->governed.get();
}

std::map<std::string, std::string> LivePipeline::recorded_variants() const {
  return *impl_->recorded_variants.get();
}

}  // namespace previz::rig
