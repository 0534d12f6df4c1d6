#include "daemon/pipeline/render_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/pipeline/refinement.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// What a plate looks like with nothing in front of it and nothing known behind it.
render::Layers plate_layers(const Plate& plate, double exposure, const ResponseCurve& curve) {
  const std::vector<double> signal = lighting::Response(curve, plate.bits).inverse();
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
  const char* what =
      track.status == tracking::TrackStatus::ambiguous ? "pose ambiguous" : "pose lost";
  return track.reason.empty() ? what : std::string(what) + ": " + track.reason;
}

}  // namespace

RenderStage::RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
                         const ObserverCalibration& calibration, const scene::Scene& scene,
                         RenderStageOptions options)
    : set_(set),
      response_(calibration.response),
      options_(std::move(options)),
      renderer_(std::move(device), set.estimation, calibration) {
  renderer_.set_scene(scene);
}

void RenderStage::operator()(Shot& shot) {
  const auto begin = std::chrono::steady_clock::now();
  const double exposure = set_.observer.exposure.value_or(shot.frame->exposure);
  Plate plate = to_plate(*shot.frame);
  if (!shot.track.pose) return pass_through(shot, std::move(plate), why_no_pose(shot.track));
  if (!shot.light) return pass_through(shot, std::move(plate), "no light frame was seen yet");

  if (light_ != shot.light) {
    renderer_.set_environment(shot.light->lighting.environment, set_.lighting.sampling);
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

void RenderStage::pass_through(Shot& shot, Plate plate, std::string reason) const {
  const double exposure = set_.observer.exposure.value_or(shot.frame->exposure);
  if (options_.layers) shot.layers = plate_layers(plate, exposure, response_);
  shot.untouched = std::move(reason);
  shot.picture = std::move(plate);
  shot.whole = true;
}

}  // namespace previz::pipeline
