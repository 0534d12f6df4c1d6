#include "daemon/core/pipeline/render_stage.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/refinement.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/render/picture/error_estimate.hpp"
#include "daemon/core/scene/placement.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// Returns the layers of a plate alone, with no virtual object in front and no geometry behind:
// everything but the composite is 0.
render::Layers plate_layers(const Plate& plate, double exposure, const lighting::Response& response,
                            const std::shared_ptr<render::Scratch>& scratch) {
  const std::vector<double>& signal = response.inverse();
  render::Layers layers = render::make_layers(plate.width, plate.height, 0, scratch);
  for (std::size_t i = 0; i < plate.samples.size(); ++i)
    layers.composite[i / 3][static_cast<glm::length_t>(i % 3)] =
        static_cast<float>(signal[plate.samples[i]] / exposure);
  return layers;
}

std::string why_no_pose(const tracking::Track& track) {
  const std::string what = std::string("pose ") + to_string(track.status);
  return track.reason.empty() ? what : what + ": " + track.reason;
}

// Returns a seed of the shot's own. The bits are mixed by the finalizer of splitmix64 (Steele et
// al. 2014), so that neighbouring indices and seeds have nothing in common.
std::uint32_t seed_of(std::uint32_t set_seed, std::uint64_t index) {
  const auto mixed = [](std::uint64_t bits) {
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
    return bits ^ (bits >> 31);
  };
  constexpr std::uint64_t step = 0x9e3779b97f4a7c15u;
  return static_cast<std::uint32_t>(mixed(mixed(set_seed + step) + (index + 1) * step) >> 32);
}

double seconds_from(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

RenderStage::RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
                         const ObserverCalibration& calibration, const scene::Scene& scene,
                         RenderStageOptions options)
    : set_(set),
      calibration_(calibration),
      options_(std::move(options)),
      scratch_(device ? render::scratch_of(*device) : nullptr),
      renderer_(std::move(options_.renderer)) {
  const ObserverCalibration picture = scaled(calibration, options_.scale);
  if (renderer_)
    renderer_->begin_set(set.estimation, picture);
  else
    renderer_ = std::make_shared<render::Renderer>(std::move(device), set.estimation, picture);
  renderer_->set_scene(scene);
  scene_.instances = scene.instances;
  scene_.lights = scene.lights;
  scene_.light_objects = scene.light_objects;
  scene_.animations = scene.animations;
  scene_.deformations = scene.deformations;
  scene_.variants = scene.variants;
  stands_elsewhere_ = options_.seeds_shots;  // so that the first shot is placed like all others
}

void RenderStage::operator()(Shot& shot) {
  const auto start = std::chrono::steady_clock::now();
  if (!begin(shot, options_.is_live) || !sample(shot)) return;
  if (options_.sample_range)
    take_sums(shot);
  else
    finish(shot);
  shot.render_s = seconds_from(start);
}

ShotUnderWay RenderStage::start(Shot shot, const render::ShowTo& to) {
  ShotUnderWay result{std::move(shot), std::nullopt, std::chrono::steady_clock::now()};
  if (view_ != render::View::composite || options_.layers) {
    (*this)(result.shot);
  } else if (begin(result.shot, options_.is_live) && sample(result.shot)) {
    result.showing = renderer_->show_later(set_.quality.denoise, to);
  }
  return result;
}

Shot RenderStage::finish(ShotUnderWay under_way) const {
  Shot& shot = under_way.shot;
  if (under_way.showing) {
    render::Showing::Shown shown = under_way.showing->finish();
    shot.picture = std::move(shown.picture);
    shot.on_card = std::move(shown.on_card);
    shot.counters = shown.counters;
    shot.whole = true;
    shot.render_s = seconds_from(under_way.begin);
  }
  return std::move(under_way.shot);
}

// Returns false if it was cancelled, or the sums from elsewhere cannot be had.
bool RenderStage::sample(Shot& shot) {
  if (options_.sums) return put_sums(shot);
  const auto is_cancelled = [&] { return cancelled(); };
  const auto progress = [&](int samples) {
    if (options_.progress) options_.progress(shot, samples);
  };
  const bool in_parts = !options_.is_live && has_fixed_samples(set_.quality);
  const Refined refined = in_parts
                              ? render_range(*renderer_, set_.quality.samples,
                                             options_.sample_range.value_or(render::SampleRange{}),
                                             is_cancelled, progress)
                              : refine(*renderer_, set_.quality, is_cancelled, progress);
  shot.error = refined.error;
  shot.samples = refined.samples;
  return refined.whole;
}

bool RenderStage::put_sums(Shot& shot) {
  const std::optional<render::SampleSums> sums = options_.sums(shot);
  if (!sums) return false;
  renderer_->put_sums(*sums);
  shot.samples = static_cast<int>(sums->samples);
  return true;
}

void RenderStage::take_sums(Shot& shot) {
  shot.counters = renderer_->counters();
  render::SampleSums sums = renderer_->take_sums();
  sums.counters = shot.counters;
  shot.sums = std::make_shared<const render::SampleSums>(std::move(sums));
  shot.whole = true;
}

render::KeptFramePtr RenderStage::keep(Shot& shot) {
  const auto start = std::chrono::steady_clock::now();
  if (!begin(shot, false) || !sample(shot)) return {};
  render::KeptFramePtr kept = renderer_->keep();
  shot.counters = renderer_->counters();
  shot.render_s = seconds_from(start);
  return kept;
}

void RenderStage::show_among(Shot& shot, const std::vector<render::KeptFramePtr>& chain) {
  const auto start = std::chrono::steady_clock::now();
  const auto layers = options_.layers ? std::make_shared<render::Layers>() : nullptr;
  stands_elsewhere_ = true;
  shot.picture = std::make_shared<const Plate>(
      renderer_->show_among(chain, set_.quality.denoise, layers.get()));
  if (layers) shot.counters.below_zero = render::below_zero(*layers);
  shot.layers = layers;
  shot.whole = true;
  shot.render_s += seconds_from(start);
}

bool RenderStage::begin(Shot& shot) {
  return begin(shot, false);
}

bool RenderStage::begin(Shot& shot, bool is_live) {
  shot.whole = false;
  const int bits = plate_bits(shot.frame->format);
  if (!response_ || response_->bits() != bits) response_.emplace(calibration_.response, bits);
  if (options_.passes_other_sizes)
    if (std::optional<std::string> why = why_other_size(*shot.frame))
      return pass_through(shot, plate_of(shot), *std::move(why)), false;
  const auto untouched = [&](std::string reason) {
    pass_through(shot, sized(shot), std::move(reason));
    return false;
  };
  const glm::dmat4* const camera = world_from_camera(shot);
  if (!camera) return untouched(why_no_pose(shot.track));
  if (!shot.light) return untouched("no light frame yet");

  light(shot);
  if (placed_ != shot.scene || is_measured_anew_ || stands_elsewhere_) place(shot.scene);
  stands_elsewhere_ = false;
  // A shot with layers can be compared with what is rendered from a take, so it stands alone.
  const bool is_shown_live = is_live && !options_.layers;
  const bool is_scaled = options_.scale != 1;
  if (is_scaled)
    if (const std::optional<std::string> why = why_other_size(*shot.frame)) throw Error(*why);
  renderer_->begin({.exposure = exposure_of(shot),
                    .world_from_camera = *camera,
                    .seed = options_.seeds_shots
                                ? std::optional(seed_of(set_.estimation.seed, shot.index))
                                : std::nullopt,
                    .accumulates = is_shown_live && set_.quality.accumulate,
                    .stands_aside = is_live && set_.quality.accumulate,
                    .dithers = is_shown_live,
                    .camera = camera_frame(shot),
                    .is_scaled = is_scaled,
                    .is_shown_whole = is_scaled && options_.is_live});
  return true;
}

bool RenderStage::add_samples(int samples) {
  renderer_->render(samples, [&] { return cancelled(); });
  renderer_->wait();  // how many come next depends on the time that these take
  return !cancelled();
}

void RenderStage::finish(Shot& shot) {
  shot.whole = true;
  const bool composite = view_ == render::View::composite;
  if (composite && !options_.layers) {
    shot.picture = std::make_shared<const Plate>(renderer_->show(set_.quality.denoise));
    shot.counters = renderer_->counters();
    return;
  }
  shot.counters = renderer_->counters();
  const auto layers = std::make_shared<render::Layers>(renderer_->layers());
  if (options_.layers) error_ = render::estimate_error(*layers).picture;
  Plate picture;
  if (composite || set_.quality.denoise)
    picture = renderer_->show(set_.quality.denoise, layers.get());
  if (!composite) picture = picture_of(view_, *layers, *response_, exposure_of(shot));
  shot.picture = std::make_shared<const Plate>(std::move(picture));
  if (!options_.layers) return;
  shot.layers = layers;
  shot.counters.below_zero = render::below_zero(*layers);
}

void RenderStage::compare_light(Shot shot, LightComparison& comparison) {
  constexpr double width = 96;
  constexpr int samples = 8;
  const double scale = options_.scale;
  const bool layers = std::exchange(options_.layers, true);  // so that it is not accumulated
  resize(std::min(scale, width / calibration_.intrinsics.width));
  if (begin(shot, true) && add_samples(samples))
    comparison.add(renderer_->layers(), renderer_->plate(), *response_);
  options_.layers = layers;
  resize(scale);
}

void RenderStage::resize(double scale) {
  if (scale == options_.scale) return;
  renderer_->resize(scaled(calibration_, scale));
  options_.scale = scale;
}

double RenderStage::exposure_of(const Shot& shot) const {
  return set_.observer.exposure.value_or(shot.frame->exposure);
}

// Gives the renderer a new light, and what the shot's state changes of its lamps.
void RenderStage::light(const Shot& shot) {
  LampStates changed = lamp_states_beside(shot.scene, set_);
  const bool is_same = light_ == shot.light && changed == relit_;
  if (is_same && !stands_elsewhere_) return;
  const LightPtr light = with_lamps_parted(shot.light, set_, shot.scene);
  if (!is_same) renderer_->set_environment(light->encoded, set_.lighting.sampling);
  // The light mode can change live, and lamps come and go: once there were lamps, the renderer must
  // also be given none.
  has_sources_ |= set_.lighting.mode != set::LightMode::image || !set_.captured_lamps.empty() ||
                  !light->lamps.empty();
  if (has_sources_) renderer_->set_sources(relit(*light, set_, shot.scene));
  is_measured_anew_ |= give_emissions(*light, set_, scene_.lights);
  std::set<std::string> missing = unmatched(*light, set_, shot.scene);
  for (const std::string& name : missing)
    if (!unmatched_.contains(name) && options_.note)
      options_.note("the adjusted lamp \"" + name + "\" is not found in the current light");
  unmatched_ = std::move(missing);
  light_ = shot.light;
  relit_ = std::move(changed);
}

void RenderStage::place(const session::SceneState& state) {
  session::SceneState known = state;
  for (const auto& [name, lamp] : relit_) known.lights.erase(name);
  const scene::Placement placement = scene::place(scene_, set_, known);
  for (const std::string& what : placement.unknown)
    if (unknown_.insert(what).second && options_.note) options_.note(what);
  renderer_->deform(placement.shapes);
  renderer_->move(placement.instances, placement.lights);
  placed_ = state;
  is_measured_anew_ = false;
}

std::optional<std::string> RenderStage::why_other_size(const Frame& frame) const {
  const PinholeIntrinsics& lens = calibration_.intrinsics;
  if (frame.width == lens.width && frame.height == lens.height) return std::nullopt;
  return "observer: a frame of " + std::to_string(frame.width) + "x" +
         std::to_string(frame.height) + " does not fit the calibration's " +
         std::to_string(lens.width) + "x" + std::to_string(lens.height);
}

// Returns the shot's plate at the size that pictures get.
PlatePtr RenderStage::sized(Shot& shot) const {
  if (options_.scale == 1 || options_.is_live) return plate_of(shot);
  if (const std::optional<std::string> why = why_other_size(*shot.frame)) throw Error(*why);
  return std::make_shared<const Plate>(scaled(*plate_of(shot), options_.scale, *response_));
}

void RenderStage::pass_through(Shot& shot, PlatePtr plate, std::string reason) const {
  if (options_.layers)
    shot.layers = std::make_shared<const render::Layers>(
        plate_layers(*plate, exposure_of(shot), *response_, scratch_));
  shot.untouched = std::move(reason);
  shot.picture = std::move(plate);
  shot.whole = true;
}

}  // namespace previz::pipeline
