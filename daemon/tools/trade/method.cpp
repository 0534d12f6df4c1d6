#include "daemon/tools/trade/method.hpp"

#include <chrono>

#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/refinement.hpp"
#include "daemon/core/pipeline/relight.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/render/picture/enlarge.hpp"

namespace previz::trade {
namespace {

ObserverCalibration method_calibration(const timing::TimedFrame& frame,
                                       const timing::FrameSettings& settings, double scale) {
  ObserverCalibration calibration = pipeline::scaled(frame.calibration(), scale);
  calibration.lens = settings.lens;
  return calibration;
}

}  // namespace

MethodRenderer::MethodRenderer(const std::shared_ptr<render::Device>& device,
                               timing::TimedFrame& frame, const scene::Scene& scene,
                               const timing::FrameSettings& settings, double sweep_scale)
    : exposure_(frame.exposure()),
      world_from_camera_(frame.world_from_camera()),
      adaptive_(settings.adaptive),
      denoise_(settings.denoise),
      plate_(frame.plate(sweep_scale * settings.scale)),
      whole_(frame.plate(sweep_scale)),
      camera_(render::plate_radiance(*whole_, frame.response(), exposure_)),
      renderer_(device, settings.estimation,
                method_calibration(frame, settings, sweep_scale * settings.scale)) {
  for (const double signal : frame.response().inverse())
    radiance_of_.push_back(static_cast<float>(signal / exposure_));
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

// A rendering that is smaller than the sweep is put onto the whole plate, as live.
TradePicture MethodRenderer::made(const render::Layers& layers) const {
  if (layers.width == whole_->width) return trade_picture(layers, camera_, 1 / exposure_);
  const auto radiance_of = [&](std::uint16_t sample) { return radiance_of_[sample]; };
  render::Layers whole;
  whole.width = whole_->width;
  whole.height = whole_->height;
  whole.composite = render::enlarged(render::additions_of(layers, *plate_, radiance_of, 1), *plate_,
                                     *whole_, radiance_of);
  return trade_picture(whole, camera_, 1 / exposure_);
}

TradePicture MethodRenderer::denoised_picture() {
  render::Layers denoised = layers_;
  renderer_.show(true, &denoised);
  return made(denoised);
}

TradePicture MethodRenderer::picture() const {
  return made(layers_);
}

}  // namespace previz::trade
