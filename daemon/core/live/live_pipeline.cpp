#include "daemon/core/live/live_pipeline.hpp"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "daemon/core/live/camera_source.hpp"
#include "daemon/core/live/live_graphics.hpp"
#include "daemon/core/live/live_light.hpp"
#include "daemon/core/live/live_output.hpp"
#include "daemon/core/live/live_render.hpp"
#include "daemon/core/live/live_tracking.hpp"
#include "daemon/core/pipeline/stages.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::live {

using pipeline::Shot;
using report::Severity;

struct LivePipeline::Impl {
  Impl(Parts the_parts, std::stop_token stop);

  void start_light();
  void start_observer();
  void start_output();
  std::optional<Shot> capture();
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
  pipeline::Mailbox<Shot> seen, tracked, reviewed, rendered;
  pipeline::Newest<std::vector<pipeline::FoundLamp>> found{{}};
  pipeline::Newest<pipeline::RecordedLook> recorded_look{{}};
  pipeline::Newest<set::PreviewStep> governed{{.samples = 0, .denoise = {}}};
  pipeline::Newest<std::optional<PassTimes>> pass_times{std::nullopt};
  pipeline::BoundedQueue<Shot> snapshots{4};  // closed by the render thread, or at a stop
  std::stop_callback<std::function<void()>> close_snapshots{stop_source.get_token(),
                                                            [this] { snapshots.close(); }};
  std::unique_ptr<CameraSource> observer, light_camera;
  std::uint64_t next_index = 0;
  int exposure_steps = 0;  // steps of Look::exposure_steps done so far
  pipeline::StageKeeper demosaicing{"conversion", parts.kept, &pipeline::Patience::stage};
  // What each thread between the cameras and the screen does.
  LiveLight light;
  LiveTracking tracking;
  LiveRender render;
  LiveGraphics graphics;
  LiveOutput output;

  std::exception_ptr failure;
  std::optional<pipeline::StageThreads> stages;
  std::jthread waiter;
};

LivePipeline::Impl::Impl(Parts the_parts, std::stop_token stop)
    : parts(std::move(the_parts)),
      stop_from_outside(std::move(stop), [this] { stop_source.request_stop(); }),
      calibration(pipeline::observer_calibration(parts.set, parts.cameras.recorded.info)),
      light({parts.set, parts.scene, parts.look, parts.kept, bool(parts.cameras.light)},
            pipeline::light_calibration(parts.set, parts.cameras.recorded.info), calibration),
      tracking({parts.set, parts.cameras, parts.recorder, parts.look, light, parts.kept},
               calibration),
      render(parts.set, parts.look, parts.inbox, parts.kept.metrics,
             {tracked, reviewed, snapshots, found, governed, recorded_look, pass_times,
              parts.kept.reports},
             parts.wants, stop_source.get_token()),
      graphics({parts.set, parts.scene, parts.device, parts.renderer, render, rendered, parts.kept},
               calibration, stop_source.get_token()),
      output({parts.set, parts.recorder, parts.look, parts.inbox, parts.show, parts.kept},
             calibration) {
  light.await_bracket(parts.cameras.light_exposures);
  stages.emplace(parts.kept.metrics, stop_source.get_token(),
                 [this] { stop_source.request_stop(); });
  if (parts.cameras.light) start_light();
  start_observer();
  start_output();
  waiter = std::jthread([this] {
    try {
      stages->wait();
    } catch (...) {
      failure = std::current_exception();
    }
    render.count_dropped();
    render.drop_under_way("stopped");
    if (tracked.try_pop()) parts.kept.metrics.dropped("render", "stopped");
    parts.inbox.finish(failure != nullptr);
  });
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

void LivePipeline::Impl::start_light() {
  light_camera = source(light_stop.get_token(), *parts.cameras.light, parts.set.light_camera.camera,
                        "light camera", "light camera", {});
  light.start(*stages, [this] {
    FramePtr frame = light_camera->next();
    if (frame) record_captured(frame);
    return frame;
  });
}

void LivePipeline::Impl::start_observer() {
  observer = source(stop_source.get_token(), *parts.cameras.observer, parts.set.observer.camera,
                    "observer", "film camera", [this](bool lost) {
                      parts.inbox.post(lost ? Event::camera_lost : Event::camera_back);
                    });
  stages->source("observer", seen, [this] { return capture(); });
  stages->stage("tracking", seen, tracked,
                [this](Shot shot) { return tracking.track(std::move(shot)); });
  stages->source(rendered, [this] {  // LiveRender counts what it renders
    std::optional<Shot> shot = graphics.next_picture();
    if (!shot) snapshots.close();
    return shot;
  });
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
    // Tracking and light want colours; the renderer makes its own.
    if (demosaicing.attempt([&] { shot.frame = demosaiced(frame); })) {
      if (shot.frame != frame) shot.camera = std::move(frame);
      return shot;
    }
    parts.kept.metrics.worked("observer", 0);
    parts.kept.metrics.dropped("tracking", "not converted");
  }
  light_stop.request_stop();  // without the observer there is nothing to light
  return std::nullopt;
}

void LivePipeline::Impl::start_output() {
  stages->sink("display", rendered, [this](Shot shot) { output.show(std::move(shot)); });
  stages->sink("snapshot", snapshots, [this](const Shot& shot) { output.write_snapshot(shot); });
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

pipeline::RecordedLook LivePipeline::recorded_look() const {
  return *impl_->recorded_look.get();
}

std::optional<PassTimes> LivePipeline::pass_times() const {
  return *impl_->pass_times.get();
}

}  // namespace previz::live
