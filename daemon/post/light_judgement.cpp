#include "daemon/post/light_judgement.hpp"

#include <algorithm>

#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/render_stage.hpp"
#include "daemon/pipeline/take_shots.hpp"
#include "daemon/set/problems.hpp"

namespace previz::post {
namespace {

constexpr std::size_t most_compared = 12;  // frames
constexpr std::size_t frames_rendered = 3;
constexpr int rendered_samples = 8;
constexpr double rendered_width = 96;
// Noise alone takes a few dark pixels below 0.
constexpr double worth_a_word = 1e-3;  // of a frame's pixels

}  // namespace

void LightJudgement::add(const pipeline::Shot& shot) {
  if (!shot.layers || !shot.untouched.empty()) return;
  if (static_cast<double>(shot.counters.below_zero) >
      worth_a_word * static_cast<double>(shot.layers->mask.size())) {
    ++frames_below_zero_;
    most_below_zero_ = std::max(most_below_zero_, shot.counters.below_zero);
  }
  if (compared_ >= most_compared) return;
  ++compared_;
  Plate plate = shot.plate ? *shot.plate : to_plate(*shot.frame);
  if (!response_ || response_->bits() != plate.bits)
    response_.emplace(take_.observer.response, plate.bits);
  if (plate.width != shot.layers->width) plate = pipeline::scaled(plate, scale_, *response_);
  comparison_.add(*shot.layers, plate, *response_);
}

std::vector<std::string> LightJudgement::doubts() const {
  std::vector<std::string> doubts;
  if (const auto found = figure())
    if (std::string remark = pipeline::light_remark(*found); !remark.empty())
      doubts.push_back(std::move(remark));
  if (frames_below_zero_ > 0)
    doubts.push_back(
        "shadows would have taken more light than the picture has, and are black, in " +
        set::plural(frames_below_zero_, "frame") + ", in up to " +
        set::plural(most_below_zero_, "pixel") +
        ": the model of what is real is brighter there than the picture");
  return doubts;
}

LightJudgement light_of_take(const pipeline::Take& take, const scene::Scene& scene,
                             const std::shared_ptr<render::Device>& device,
                             const std::stop_token& stop) {
  set::Set set = take.set;
  set.estimation.estimator = set::Estimator::paired;
  set.quality.denoise = false;
  set.quality.samples = rendered_samples;
  set.quality.adaptive = false;
  set.quality.error = set.quality.seconds = 0;
  pipeline::RenderStageOptions options;
  options.layers = true;
  options.scale = std::min(1.0, rendered_width / take.observer.intrinsics.width);
  options.cancelled = [&] { return stop.stop_requested(); };
  pipeline::RenderStage render(device, set, take.observer, scene, options);
  LightJudgement judgement(take, options.scale);
  const std::size_t frames = take.observer_stream->records().size();
  std::size_t part = 0;
  pipeline::TakeShots shots(
      take,
      {.wanted = [&](std::uint64_t frame) { return frame >= part * frames / frames_rendered; },
       .from_start = false,
       .scene = &scene,
       .stop = stop});
  while (part < frames_rendered) {
    std::optional<pipeline::Shot> shot = shots.next();
    if (!shot) break;
    if (!shot->track.pose || !shot->light) continue;
    while (part < frames_rendered && shot->index >= part * frames / frames_rendered) ++part;
    render(*shot);
    shot->counters.below_zero = 0;  // by the noise of so few samples
    if (shot->whole) judgement.add(*shot);
  }
  return judgement;
}

}  // namespace previz::post
