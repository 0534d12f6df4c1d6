#include "daemon/trade/method.hpp"

#include <chrono>

#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/refinement.hpp"
#include "daemon/pipeline/relight.hpp"
#include "daemon/render/composite.hpp"

namespace previz::trade {
namespace {

ObserverCalibration method_calibration(const TradeFrame& frame, const TradeSettings& settings,
                                       double scale) {
  ObserverCalibration calibration = pipeline::scaled(frame.calibration(), scale);
  calibration.lens = settings.lens;
  return calibration;
}

}  // namespace

MethodRenderer::MethodRenderer(const std::shared_ptr<render::Device>& device, TradeFrame& frame,
                               const scene::Scene& scene, const TradeSettings& settings,
                               double sweep_scale)
    : exposure_(frame.exposure()),
      world_from_camera_(frame.world_from_camera()),
      adaptive_(settings.adaptive),
      denoise_(settings.denoise),
      plate_(frame.plate(sweep_scale * settings.scale)),
      camera_(render::plate_radiance(*plate_, frame.response(), exposure_).value),
      renderer_(device, settings.estimation,
                method_calibration(frame, settings, sweep_scale * settings.scale)) {
  renderer_.set_scene(scene);
  const pipeline::LightPtr light = frame.light(settings.lighting, scene);
  std::vector<set::Light> lamps = scene.lights;
  if (pipeline::give_emissions(*light, frame.set(), lamps)) renderer_.move(scene.instances, lamps);
  renderer_.set_environment(light->encoded, settings.lighting.sampling);
  if (settings.lighting.mode != set::LightMode::image || !light->lamps.empty())
    renderer_.set_sources(pipeline::relit(*light, frame.set(), {}));
  renderer_.carry(settings.carried);
}

void MethodRenderer::warm_up() {
  begin(0);
  render(1);
}

void MethodRenderer::begin(std::uint32_t seed) {
  renderer_.begin({plate_, exposure_, world_from_camera_, seed});
}

double MethodRenderer::render(int samples) {
  const auto start = std::chrono::steady_clock::now();
  set::Quality quality;
  quality.samples = samples;
  quality.adaptive = adaptive_;
  pipeline::refine(renderer_, quality, {}, {});
  layers_ = renderer_.layers();
  if (denoise_) renderer_.show(true, &layers_);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void MethodRenderer::add(int samples) {
  renderer_.render(samples);
  layers_ = renderer_.layers();
}

TradePicture MethodRenderer::denoised_picture() {
  render::Layers denoised = layers_;
  renderer_.show(true, &denoised);
  return trade_picture(denoised, camera_, 1 / exposure_);
}

TradePicture MethodRenderer::picture() const {
  return trade_picture(layers_, camera_, 1 / exposure_);
}

}  // namespace previz::trade
