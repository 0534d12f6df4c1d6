#include "daemon/core/live/live_graphics.hpp"

#include <thread>
#include <utility>

#include "daemon/core/live/graphics.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/report/report.hpp"

namespace previz::live {

using pipeline::Shot;
using report::Severity;

LiveGraphics::LiveGraphics(Parts parts, const ObserverCalibration& calibration,
                           std::stop_token stop)
    : parts_(std::move(parts)),
      calibration_(calibration),
      stop_(std::move(stop)),
      keeper_(gpu(), {parts_.kept.reports, parts_.kept.metrics, stop_,
                      [this](std::chrono::milliseconds time) { show_plates(time); }}),
      rendering_("render", parts_.kept, &pipeline::Patience::render, [this] { begin_anew(); }) {
  keeper_.start();
}

// Pipelines are compiled while the scene is made and the cameras are opened, so that the first
// picture also comes sooner.
void LiveGraphics::begin_ahead() {
  ahead_.reset();
  are_ahead_ = false;
  const bool is_processor = render::memory_of(*parts_.device).read_back;
  if (is_processor) return;
  ahead_.emplace(parts_.device, [this] {
    return render::reachable_bits(parts_.set, parts_.scene, calibration_.lens.has_value());
  });
}

// Asking a driver for all that it has compiled takes a moment, in which no picture comes. So that
// is done once all pipelines are there, and not after each of them.
void LiveGraphics::keep_programs() {
  if (ahead_ && !ahead_->is_done()) return;
  if (ahead_ && !std::exchange(are_ahead_, true) && ahead_->has_all())
    parts_.kept.metrics.count("all pipelines are made ahead");
  render::keep_programs(*parts_.device);
}

void LiveGraphics::make_stage() {
  begin_ahead();
  stage_.emplace(parts_.device, parts_.set, calibration_, parts_.scene,
                 pipeline::RenderStageOptions{
                     .renderer = std::exchange(parts_.renderer, nullptr),
                     .is_live = true,
                     .scale = parts_.set.quality.scale,
                     .passes_other_sizes = true,
                     .cancelled = [this] { return parts_.render.interrupted(); },
                     .progress = {},
                     .note =
                         [this](const std::string& what) {
                           parts_.kept.reports(report::once({Severity::warning, "", what}));
                         }});
  parts_.renderer = stage_->renderer();
  parts_.render.use(*stage_);
  let_recording_first();
}

void LiveGraphics::drop_stage() {
  ahead_.reset();
  parts_.render.use_none();
  stage_.reset();
  parts_.renderer.reset();
}

// A renderer that fails again is made on a reopened device.
void LiveGraphics::begin_anew() {
  drop_stage();
  if (++begun_anew_ > 1) gpu().open();
  keeper_.start();
}

GpuKeeper::Gpu LiveGraphics::gpu() {
  return {.is_open = [this] { return render::is_open(*parts_.device); },
          .open =
              [this] {
                parts_.renderer.reset();  // it is of the device that was lost
                ahead_.reset();           // likewise
                render::reopen_device(*parts_.device, parts_.set.quality.cpu_instead);
              },
          .name = [this] { return render::drawing_device(*parts_.device); },
          .stands_in = [this] { return render::cpu_stands_in(*parts_.device); },
          .build = [this] { make_stage(); },
          .drop = [this] { drop_stage(); }};
}

// While there is no graphics device, the crew sees what the camera sees. Only this may take any
// time: a driver can hang in each attempt to open the device or to make the renderer.
void LiveGraphics::show_plates(std::chrono::milliseconds time) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + time;
  rendering_.waits();
  while (!stop_.stop_requested() && Clock::now() < end) {
    if (std::optional<Shot> shot = parts_.render.next_plate("no graphics card"))
      parts_.rendered.push(*std::move(shot));
    else if (parts_.render.finished())
      std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a stop comes soon
  }
  rendering_.goes_on();
}

// While the renderer is rebuilt, the crew sees the plate.
std::optional<Shot> LiveGraphics::next_picture() {
  const auto renew = [this](const render::DeviceLost& lost) { return keeper_.renew(lost); };
  for (;;) {
    std::optional<Shot> shot;
    const bool is_well = rendering_.attempt([&] {
      if (!keeper_.await()) return rendering_.had_nothing_to_do();
      rendering_.goes_on();
      shot = parts_.render.next(renew);
      if (!shot) return rendering_.had_nothing_to_do();
      begun_anew_ = 0;
      if (render::is_open(*parts_.device)) keep_programs();
    });
    if (!is_well) {
      drop_stage();
      shot = parts_.render.next_plate("the renderer has failed");
    }
    if (shot || parts_.render.finished()) return shot;
  }
}

}  // namespace previz::live
