#include "daemon/core/check/light_judgement.hpp"

#include <algorithm>

#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/set/problems.hpp"

namespace previz::check {
namespace {

constexpr std::size_t most_compared = 12;  // frames
constexpr std::size_t frames_compared = 3;
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
  if (const auto found = comparison_.figure())
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

std::optional<pipeline::LightFigure> light_of_take(const pipeline::Take& take,
                                                   const scene::Scene& scene,
                                                   const std::shared_ptr<render::Device>& device) {
  set::Set set = take.set;
  set.estimation.estimator = set::Estimator::paired;
  pipeline::RenderStage render(device, set, take.observer, scene, {});
  pipeline::LightComparison comparison;
  const std::size_t frames = take.observer_stream->records().size();
  std::size_t part = 0;
  pipeline::TakeShots shots(
      take,
      {.wanted = [&](std::uint64_t frame) { return frame >= part * frames / frames_compared; },
       .from_start = false,
       .scene = &scene});
  while (part < frames_compared) {
    std::optional<pipeline::Shot> shot = shots.next();
    if (!shot) break;
    if (!shot->track.pose || !shot->light) continue;
    while (part < frames_compared && shot->index >= part * frames / frames_compared) ++part;
    render.compare_light(*std::move(shot), comparison);
  }
  return comparison.figure();
}

}  // namespace previz::check
