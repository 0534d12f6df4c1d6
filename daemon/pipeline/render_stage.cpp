#include "daemon/pipeline/render_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/refinement.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// What a plate looks like with nothing in front of it and nothing known behind it.
render::Layers plate_layers(const Plate& plate, double exposure,
                            const lighting::Response& response) {
  const std::vector<double>& signal = response.inverse();
  render::Layers layers;
  layers.width = plate.width;
  layers.height = plate.height;
  const std::size_t pixels = std::size_t(plate.width) * std::size_t(plate.height);
  for (auto* layer : {&layers.mixed, &layers.real, &layers.diff, &layers.normal, &layers.variance})
    layer->resize(pixels);
  layers.mask.resize(pixels);
  layers.depth.resize(pixels);
  layers.composite.reserve(pixels);
  const auto radiance = [&](std::size_t sample) {
    return static_cast<float>(signal[plate.samples[sample]] / exposure);
  };
  for (std::size_t i = 0; i < pixels; ++i)
    layers.composite.emplace_back(radiance(3 * i), radiance(3 * i + 1), radiance(3 * i + 2));
  return layers;
}

std::string why_no_pose(const tracking::Track& track) {
  const std::string what = std::string("pose ") + to_string(track.status);
  return track.reason.empty() ? what : what + ": " + track.reason;
}

}  // namespace

RenderStage::RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
                         const ObserverCalibration& calibration, const scene::Scene& scene,
                         RenderStageOptions options)
    : set_(set),
      calibration_(calibration),
      options_(std::move(options)),
      renderer_(std::move(device), set.estimation, scaled(calibration, options_.scale)) {
  renderer_.set_scene(scene);
}

void RenderStage::operator()(Shot& shot) {
  if (!shot.wanted) return;
  const auto begin = std::chrono::steady_clock::now();
  const double exposure = set_.observer.exposure.value_or(shot.frame->exposure);
  Plate plate = plate_of(*shot.frame);
  if (!shot.track.pose) return pass_through(shot, std::move(plate), why_no_pose(shot.track));
  if (!shot.light) return pass_through(shot, std::move(plate), "no light frame was seen yet");

  if (light_ != shot.light) {
    renderer_.set_environment(shot.light->encoded, set_.lighting.sampling);
    if (set_.lighting.mode != set::LightMode::image) renderer_.set_sources(shot.light->lamps);
    light_ = shot.light;
  }
  renderer_.begin({std::move(plate), exposure, shot.track.pose->world_from_camera});
  const auto cancelled = [&] { return options_.cancelled && options_.cancelled(); };
  const Refined refined = refine(renderer_, set_.quality, cancelled, [&](int samples) {
    if (options_.progress) options_.progress(shot, samples);
  });
  shot.whole = refined.whole;
  shot.error = refined.error;
  if (!shot.whole) return;
  shot.picture = renderer_.picture();
  shot.counters = renderer_.counters();
  if (options_.layers) shot.layers = renderer_.layers();
  shot.render_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

Plate RenderStage::plate_of(const Frame& frame) {
  Plate plate = to_plate(frame);
  if (!response_ || response_->bits() != plate.bits)
    response_.emplace(calibration_.response, plate.bits);
  if (options_.scale == 1) return plate;
  const PinholeIntrinsics& lens = calibration_.intrinsics;
  if (plate.width != lens.width || plate.height != lens.height)
    throw Error("observer: a frame of " + std::to_string(plate.width) + "x" +
                std::to_string(plate.height) + " does not fit the calibration's " +
                std::to_string(lens.width) + "x" + std::to_string(lens.height));
  return scaled(plate, options_.scale, *response_);
}

void RenderStage::pass_through(Shot& shot, Plate plate, std::string reason) const {
  const double exposure = set_.observer.exposure.value_or(shot.frame->exposure);
  if (options_.layers) shot.layers = plate_layers(plate, exposure, *response_);
  shot.untouched = std::move(reason);
  shot.picture = std::move(plate);
  shot.whole = true;
}

}  // namespace previz::pipeline
