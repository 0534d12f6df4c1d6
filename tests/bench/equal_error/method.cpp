#include "tests/bench/equal_error/method.hpp"

#include "daemon/core/pipeline/refinement.hpp"
#include "tests/bench/measure.hpp"

namespace previz::bench {

MethodRun::MethodRun(const std::shared_ptr<render::Device>& device, const View& view,
                     const Method& method)
    : world_from_camera_(view.world_from_camera),
      exposure_(view.exposure),
      adaptive_(method.adaptive),
      denoise_(method.denoise) {
  set::Estimation estimation = method.estimation;
  if (method.separate) estimation.estimator = set::Estimator::paired;
  const auto add = [&](const scene::Scene& scene) {
    renderers_.push_back(std::make_unique<render::Renderer>(device, estimation, view.camera));
    renderers_.back()->set_scene(scene);
    renderers_.back()->set_environment(view.environment, method.sampling);
    if (!view.lamps.empty()) renderers_.back()->set_sources(view.lamps);
  };
  if (method.separate) {
    add(world_alone(view.scene, scene::world_mixed));
    add(world_alone(view.scene, scene::world_real));
  } else {
    add(view.scene);
  }
  begin(0);
  render(1);
  if (denoise_) estimate();
}

void MethodRun::begin(std::uint32_t seed) {
  samples_ = 0;
  cpu_s_ = denoise_s_ = 0;
  seed_ = seed;
  begin_frame();
}

void MethodRun::begin_frame() {
  for (std::size_t i = 0; i < renderers_.size(); ++i) {
    render::FrameInput frame;
    frame.world_from_camera = world_from_camera_;
    frame.exposure = exposure_;
    frame.seed = 2 * seed_ + static_cast<std::uint32_t>(i);
    renderers_[i]->begin(frame);
  }
}

void MethodRun::render(int samples) {
  samples_ += samples;
  if (adaptive_) return render_anew();
  const double start = cpu_seconds();
  for (const auto& renderer : renderers_) renderer->render(samples);
  cpu_s_ += cpu_seconds() - start;
}

void MethodRun::render_anew() {
  begin_frame();
  set::Quality quality;
  quality.samples = samples_;
  quality.adaptive = true;
  const double start = cpu_seconds();
  pipeline::refine(*renderers_.front(), quality, {}, {});
  cpu_s_ = cpu_seconds() - start;
}

render::Counters MethodRun::counters() const {
  render::Counters sum;
  for (const auto& renderer : renderers_) {
    const render::Counters one = renderer->counters();
    sum.rays += one.rays;
    sum.shadow_rays += one.shadow_rays;
    sum.dropped_not_finite += one.dropped_not_finite;
    sum.dropped_negative += one.dropped_negative;
    sum.stopped_in_layers += one.stopped_in_layers;
    sum.unfinished += one.unfinished;
  }
  return sum;
}

void MethodRun::denoise(render::Layers& layers) {
  const double start = cpu_seconds();
  renderers_.front()->show(true, &layers);
  denoise_s_ = cpu_seconds() - start;
}

truth::EstimatedFrame MethodRun::estimate() {
  render::Layers first = renderers_.front()->layers();
  if (denoise_) denoise(first);
  truth::EstimatedFrame estimate;
  estimate.mixed = std::move(first.mixed);
  estimate.real =
      renderers_.size() == 1 ? std::move(first.real) : std::move(renderers_.back()->layers().mixed);
  estimate.diff = std::move(first.diff);
  if (renderers_.size() > 1)
    for (std::size_t i = 0; i < estimate.diff.size(); ++i)
      estimate.diff[i] = estimate.mixed[i] - estimate.real[i];
  estimate.mask = std::move(first.mask);
  if (!denoise_) return estimate;
  estimate.composite = std::move(first.composite);
  estimate = truth::as_composited({}, std::move(estimate));  // there is no plate
  estimate.composite.clear();
  return estimate;
}

}  // namespace previz::bench
