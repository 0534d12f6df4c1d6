#include "daemon/rig/live.hpp"

#include <mutex>
#include <ostream>
#include <string>
#include <utility>
#include <variant>

#include "daemon/pipeline/light_feed.hpp"
#include "daemon/pipeline/light_stage.hpp"
#include "daemon/pipeline/news.hpp"
#include "daemon/pipeline/render_stage.hpp"
#include "daemon/pipeline/stages.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/pipeline/track_stage.hpp"
#include "daemon/rig/cameras.hpp"
#include "daemon/rig/headless_display.hpp"
#include "daemon/scene/scene.hpp"
#include "drivers/error.hpp"

namespace previz::rig {
namespace {

using pipeline::LightPtr;
using pipeline::Shot;

// News from any thread.
class Notes {
 public:
  explicit Notes(std::ostream& out) : out_(out) {}
  void operator()(const std::string& note) {
    const std::lock_guard lock(mutex_);
    if (news_.is_new(note)) out_ << note << std::endl;
  }

 private:
  std::mutex mutex_;
  pipeline::News news_;
  std::ostream& out_;
};

// Frames of a camera until its stream ends or a stop is requested; trouble is noted and counted.
class CameraSource {
 public:
  CameraSource(Camera& camera, std::string stage, std::stop_token stop, Notes& notes,
               pipeline::Metrics& metrics)
      : camera_(camera),
        stage_(std::move(stage)),
        stop_(std::move(stop)),
        notes_(notes),
        metrics_(metrics) {}

  FramePtr next() {
    while (!stop_.stop_requested()) {
      CameraEvent event = camera_.next(std::chrono::milliseconds(100));
      if (std::holds_alternative<EndOfStream>(event)) return nullptr;
      if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) {
        notes_(trouble->device + ": " + trouble->what);
        metrics_.count(stage_ + ": device trouble");
      } else if (auto* frame = std::get_if<FramePtr>(&event)) {
        const std::uint64_t sequence = (*frame)->sequence;
        if (last_sequence_ && sequence > *last_sequence_ + 1)
          metrics_.dropped(stage_, "by the device", sequence - *last_sequence_ - 1);
        last_sequence_ = sequence;
        return std::move(*frame);
      }
    }
    return nullptr;
  }

 private:
  Camera& camera_;
  const std::string stage_;
  const std::stop_token stop_;
  Notes& notes_;
  pipeline::Metrics& metrics_;
  std::optional<std::uint64_t> last_sequence_;
};

// The estimate of the light from all frames that waited; what it has to say is noted.
class LightWork {
 public:
  LightWork(pipeline::LightStage& stage, Notes& notes, pipeline::Metrics& metrics)
      : stage_(stage), notes_(notes), metrics_(metrics) {}

  LightPtr operator()(std::vector<pipeline::LightFrame> frames,
                      const std::optional<pipeline::ObserverView>& view) {
    if (view) stage_.see_observer(*view->frame, view->world_from_camera);
    for (pipeline::LightFrame& light_frame : frames)
      stage_.see(std::move(light_frame.frame), light_frame.index);
    for (const std::string& trouble : stage_.troubles()) {
      notes_("light: " + trouble);
      metrics_.dropped("lighting", "not usable");
    }
    LightPtr light = stage_.light();
    if (light)
      for (const std::string& what : light->lighting.report.notes) notes_("light: " + what);
    return light;
  }

 private:
  pipeline::LightStage& stage_;
  Notes& notes_;
  pipeline::Metrics& metrics_;
};

}  // namespace

pipeline::MetricsSnapshot run_live(const LiveOptions& options, std::ostream& out) {
  set::Set set = set::load_set(options.set_file);
  if (options.samples) set.quality.samples = *options.samples;
  if (options.directory) set.output.directory = *options.directory;

  Notes note(out);
  pipeline::Metrics metrics;
  const scene::Scene scene = scene::load_scene(set);
  for (const std::string& what : scene.notes) note("scene: " + what);
  const std::shared_ptr<render::Device> device = render::open_device(options.device);
  HeadlessDisplay display(set.output.directory, metrics);

  Cameras cameras = open_cameras(set, options.loop);
  const ObserverCalibration calibration =
      pipeline::observer_calibration(set, cameras.recorded.info);
  pipeline::TrackStage track(set, calibration, cameras.recorded.track);
  pipeline::LightStage lighting(set, pipeline::light_calibration(set, cameras.recorded.info),
                                calibration);
  if (lighting.needs_frames() && !cameras.light)
    throw Error(set.file.string() +
                ": lighting: the set has neither a light camera nor lighting.environment");
  pipeline::RenderStageOptions render_options;
  render_options.cancelled = [&] { return options.stop.stop_requested(); };
  render_options.scale = set.quality.scale;
  pipeline::RenderStage render(device, set, calibration, scene, std::move(render_options));
  out << "live on " << render::device_name(*device) << ", " << set.quality.samples
      << " samples a frame" << std::endl;

  pipeline::LightFeed light(cameras.light ? nullptr : lighting.light());
  pipeline::Mailbox<Shot> seen, tracked, rendered;
  pipeline::StageThreads stages(metrics, options.stop);

  if (cameras.light)
    light.start(
        stages,
        [source = CameraSource(*cameras.light, "light camera", options.stop, note, metrics),
         index = std::uint64_t{0}]() mutable -> std::optional<pipeline::LightFrame> {
          FramePtr frame = source.next();
          if (!frame) return std::nullopt;
          return pipeline::LightFrame{std::move(frame), index++};
        },
        LightWork(lighting, note, metrics));
  stages.source("observer", seen,
                [source = CameraSource(*cameras.observer, "observer", options.stop, note, metrics),
                 index = std::uint64_t{0}]() mutable -> std::optional<Shot> {
                  Shot shot;
                  shot.frame = source.next();
                  if (!shot.frame) return std::nullopt;
                  shot.index = index++;
                  shot.arrived = std::chrono::steady_clock::now();
                  return shot;
                });
  stages.stage("tracking", seen, tracked, [&](Shot shot) {
    track(shot);
    if (lighting.needs_observer() && shot.track.pose)
      light.see_observer({shot.frame, shot.track.pose->world_from_camera});
    return shot;
  });
  stages.stage("render", tracked, rendered, [&](Shot shot) {
    shot.light = light.newest();
    render(shot);
    return shot;
  });
  stages.sink("display", rendered, [&](Shot shot) {
    if (!shot.whole) return metrics.dropped("display", "stopped while rendering");
    if (!shot.untouched.empty()) {
      metrics.count("plate untouched: " + shot.untouched);
      note("plate untouched: " + shot.untouched);
    }
    const render::Counters& counters = shot.counters;
    if (counters.dropped_not_finite + counters.dropped_negative + counters.stopped_in_layers > 0) {
      metrics.count("samples not finite", counters.dropped_not_finite);
      metrics.count("samples negative", counters.dropped_negative);
      metrics.count("rays stopped by the last of too many transparent surfaces",
                    counters.stopped_in_layers);
    }
    display.show(std::move(shot));
  });
  stages.wait();
  return display.write();
}

}  // namespace previz::rig
