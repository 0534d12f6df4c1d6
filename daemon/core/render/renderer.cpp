#include "daemon/core/render/renderer.hpp"

#include <algorithm>
#include <cassert>
#include <optional>
#include <span>
#include <utility>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/render/corner_rays.hpp"
#include "daemon/core/render/device/card_pictures.hpp"
#include "daemon/core/render/device/plate_pool.hpp"
#include "daemon/core/render/frame_camera.hpp"
#include "daemon/core/render/kept_frame.hpp"
#include "daemon/core/render/passes/denoiser.hpp"
#include "daemon/core/render/passes/device_plate.hpp"
#include "daemon/core/render/passes/history.hpp"
#include "daemon/core/render/passes/photon_schedule.hpp"
#include "daemon/core/render/passes/presenter.hpp"
#include "daemon/core/render/passes/showing_state.hpp"
#include "daemon/core/render/passes/wavefront.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/render/picture/picture_memory.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/render/world/gpu_scene.hpp"
#include "drivers/error.hpp"

namespace previz::render {

struct Renderer::Impl {
  Impl(std::shared_ptr<Device> the_device, const set::Estimation& the_estimation,
       const ObserverCalibration& the_calibration)
      : device(std::move(the_device)),
        estimation(the_estimation),
        calibration(the_calibration),
        scene(*device),
        on_card(*device),
        plate(*device) {
    make_wavefront();
  }

  void make_wavefront();
  void upload_rays();

  void upload_frame();
  std::uint32_t photons() const;  // a pass
  std::uint32_t needed() const;   // FEATURE_* bits of this frame
  CompositeRule rule() const {
    return {estimation.composite, estimation.composite_floor / frame.exposure};
  }
  std::int64_t sampled() const { return std::max<std::int64_t>(samples, 1); }
  const std::vector<float>& radiance_of_codes();
  bool has_plate() const { return frame.camera || (frame.plate && !frame.plate->samples.empty()); }
  const Plate& codes();
  Presenter& shown_by();
  PlateRadiance plate_radiance() {
    return render::plate_radiance(codes(), *response, frame.exposure);
  }
  void upload_plate();
  void take(FrameInput input);
  void place();
  void begin_accumulating();
  void add_view();
  void put_back(const KeptFrame& kept);
  void forget_samples() {
    samples = first_sample = 0;
    counted_elsewhere = {};
  }
  ToPresent to_present(bool denoise);
  Counters host_counters() const;

  std::shared_ptr<Device> device;
  set::Estimation estimation;
  ObserverCalibration calibration;
  GpuScene scene;
  std::optional<Wavefront> wavefront;
  std::optional<Denoiser> denoiser;    // made when a picture is first shown
  PlatePool pictures;                  // of show_later()
  CardPictures on_card;                // likewise
  std::optional<Presenter> presenter;  // likewise; made for the response
  std::optional<History> history;      // made when a frame first accumulates, or is shown among
                                       // others
  LightCells light;                    // of the environment
  std::uint32_t past_samples = 0;      // of the frames that were accumulated before this one
  bool counts_samples = false;         // this frame's are accumulated
  bool has_separate_parts = false;     // this frame's (Renderer::separate_parts)
  Buffers scene_buffers;               // of the current frame
  std::uint32_t features = 0;          // of the current frame
  Buffer rays, frame_buffer;
  DevicePlate plate;
  bool is_clipped = false;    // some code of the plate may mean "at least so much light"
  std::uint32_t carried = 0;  // FEATURE_* bits
  bool has_scene = false, has_environment = false;
  FrameInput frame;
  std::optional<lighting::Response> response;
  std::vector<float> radiance;                    // of codes, for this response
  double radiance_exposure = 0;                   // and this exposure
  std::int64_t samples = 0;                       // in the sums
  std::int64_t first_sample = 0;                  // the index of the first of them
  Counters counted_elsewhere;                     // of samples in the sums that put_sums() brought
  std::uint64_t trees_now = 0, trees_before = 0;  // rebuilt up to this frame's begin and the last's
};

void Renderer::Impl::make_wavefront() {
  const PinholeIntrinsics& picture = calibration.intrinsics;
  wavefront.reset();  // frees the old memory before the new is allocated
  wavefront.emplace(*device, picture.width, picture.height,
                    estimation.real_radiance == set::RealRadiance::camera ? 3 : 2);
  upload_rays();
}

void Renderer::Impl::upload_rays() {
  const PinholeIntrinsics& lens = calibration.intrinsics;
  const Purpose purpose{"the rays", "make the picture smaller", lens.width, lens.height};
  upload_texels(*device, purpose, rays, corner_rays(calibration.intrinsics),
                vk::Format::eR32G32Sfloat);
}

void Renderer::Impl::upload_frame() {
  gpu::GpuFrame gpu_frame{};
  describe_camera(gpu_frame, calibration, frame.world_from_camera);
  gpu_frame.seed = frame.seed.value_or(estimation.seed);
  gpu_frame.max_depth = static_cast<std::uint32_t>(estimation.max_depth);
  gpu_frame.roulette_depth = static_cast<std::uint32_t>(estimation.roulette_depth);
  gpu_frame.specular_alpha = static_cast<float>(estimation.specular_roughness);
  gpu_frame.bound_share = static_cast<float>(estimation.difference_sampling);
  gpu_frame.photon_count = photons();
  gpu_frame.exposure = static_cast<float>(frame.exposure);
  gpu_frame.past_samples = frame.accumulates ? past_samples : 0;
  gpu_frame.has_separate_parts = has_separate_parts ? 1 : 0;
  constexpr std::uint32_t patterned = gpu::FEATURE_TEXTURES | gpu::FEATURE_VERTEX_COLORS;
  gpu_frame.keeps_albedo = (needed() & patterned) != 0 ? 1 : 0;
  gpu_frame.clip_from = is_clipped ? response->clipping().from : gpu::NO_INDEX;
  scene.describe(gpu_frame, needed());
  const Purpose purpose{"the frame's settings", "close other programs"};
  upload_uniform(*device, purpose, frame_buffer, gpu_frame);
}

std::uint32_t Renderer::Impl::photons() const {
  return photon_count(estimation.photons, calibration.intrinsics.width,
                      calibration.intrinsics.height, wavefront->most_photons());
}

std::uint32_t Renderer::Impl::needed() const {
  Demand demand = scene.demand(estimation);
  demand.has_aperture = calibration.lens.has_value();
  demand.has_plate = has_plate();
  return needed_bits(demand);
}

// Returns the linear radiance that each code of the plate stands for.
const std::vector<float>& Renderer::Impl::radiance_of_codes() {
  const std::vector<double>& signals = response->inverse();
  if (radiance.size() == signals.size() && radiance_exposure == frame.exposure) return radiance;
  radiance.clear();
  for (const double signal : signals)
    radiance.push_back(static_cast<float>(signal / frame.exposure));
  radiance_exposure = frame.exposure;
  return radiance;
}

void Renderer::Impl::upload_plate() {
  const std::uint32_t clipped = response->clipping().from;
  is_clipped =
      frame.camera ? has_at_least(*frame.camera, clipped) : has_at_least(*frame.plate, clipped);
  const PinholeIntrinsics& lens = calibration.intrinsics;
  if (frame.is_scaled)
    plate.take(*frame.camera, lens.width, lens.height, shown_by().tables());
  else if (frame.plate)
    plate.take(*frame.plate);
  else
    plate.take(*frame.camera);
}

// Returns the plate in the computer's memory.
const Plate& Renderer::Impl::codes() {
  if (frame.plate) return *frame.plate;
  const PinholeIntrinsics& lens = calibration.intrinsics;
  const std::size_t count =
      std::size_t{3} * static_cast<std::size_t>(lens.width) * static_cast<std::size_t>(lens.height);
  frame.plate =
      std::make_shared<const Plate>(Plate{lens.width, lens.height, response->bits(),
                                          download<std::uint16_t>(*device, plate.codes(), count)});
  return *frame.plate;
}

// Returns what makes the shown picture, for the response.
Presenter& Renderer::Impl::shown_by() {
  if (!presenter) presenter.emplace(*device, *response);
  return *presenter;
}

void Renderer::Impl::begin_accumulating() {
  past_samples += counts_samples ? static_cast<std::uint32_t>(samples) : 0;
  counts_samples = frame.accumulates;
  if (!frame.accumulates) {
    if (frame.stands_aside) return;
    past_samples = 0;
    if (history) history->forget();
    return;
  }
  if (!history) {
    history.emplace(*device);
    history->light_with(light);  // that was set before
  }
  history->light_with(scene.lamps());
  add_view();
}

void Renderer::Impl::add_view() {
  history->begin({calibration.intrinsics, frame.world_from_camera, 1 / frame.exposure},
                 scene.stances());
}

Renderer::Renderer(std::shared_ptr<Device> device, const set::Estimation& estimation,
                   const ObserverCalibration& calibration) {
  refuse_too_large(calibration.intrinsics, memory_of(*device));
  impl_ = std::make_unique<Impl>(std::move(device), estimation, calibration);
}
Renderer::~Renderer() = default;

void Renderer::set_scene(const scene::Scene& scene) {
  impl_->scene.set_scene(scene, impl_->estimation.specular_roughness,
                         impl_->estimation.filter_textures);
  if (impl_->history) impl_->history->forget();
  impl_->has_scene = true;
  impl_->trees_now = impl_->trees_before = impl_->scene.rebuilt_trees();
}

void Renderer::begin_set(const set::Estimation& estimation,
                         const ObserverCalibration& calibration) {
  refuse_too_large(calibration.intrinsics, memory_of(*impl_->device));
  Impl& r = *impl_;
  const PinholeIntrinsics &before = r.calibration.intrinsics, &now = calibration.intrinsics;
  const bool has_room = r.wavefront && before.width == now.width && before.height == now.height &&
                        r.estimation.real_radiance == estimation.real_radiance;
  r.estimation = estimation;
  r.calibration = calibration;
  r.scene.set_sources(std::nullopt);
  r.has_scene = r.has_environment = false;
  r.carried = 0;
  r.frame = {};
  r.forget_samples();
  r.past_samples = 0;
  r.history.reset();
  r.response.reset();
  r.radiance.clear();
  r.presenter.reset();
  if (has_room)  // the pipelines stay, if they are those that the set needs
    r.upload_rays();
  else
    r.make_wavefront();
}

void Renderer::set_environment(const lighting::EnvironmentMap& environment,
                               set::LightSampling sampling) {
  set_environment(encode_environment(environment), sampling);
}

void Renderer::set_environment(const EncodedEnvironment& environment, set::LightSampling sampling) {
  impl_->scene.set_environment(environment, sampling);
  impl_->light = light_cells(environment);
  if (impl_->history) impl_->history->light_with(impl_->light);
  impl_->has_environment = true;
}

void Renderer::move(const std::vector<scene::Instance>& instances,
                    const std::vector<set::Light>& lights) {
  impl_->scene.move(instances, lights);
}

void Renderer::deform(const std::vector<scene::Shape>& shapes) {
  impl_->scene.deform(shapes);
}

void Renderer::use(set::Estimator estimator) {
  impl_->estimation.estimator = estimator;
}

void Renderer::resize(const ObserverCalibration& calibration) {
  refuse_too_large(calibration.intrinsics, memory_of(*impl_->device));
  impl_->calibration = calibration;
  impl_->wavefront->resize(calibration.intrinsics.width, calibration.intrinsics.height);
  impl_->upload_rays();
}

void Renderer::set_sources(std::vector<set::Light> sources) {
  impl_->scene.set_sources(std::move(sources));
}

void Renderer::carry(std::uint32_t features) {
  impl_->carried |= features;
}

std::uint32_t Renderer::needed() const {
  return impl_->needed();
}

// Makes this the current frame. Throws if its plate does not fit the calibration.
void Renderer::Impl::take(FrameInput input) {
  const PinholeIntrinsics& lens = calibration.intrinsics;
  if (input.camera) check_size(*input.camera);
  const int bits = refuse_other_size(input, lens);
  if (!input.camera && !input.plate) input.plate = std::make_shared<const Plate>();
  frame = std::move(input);
  if (!response || response->bits() != bits) {
    response.emplace(calibration.response, bits);
    radiance.clear();
    presenter.reset();
  }
}

// Uploads the current frame and the scene around its camera.
void Renderer::Impl::place() {
  upload_plate();
  scene.place(glm::dvec3(frame.world_from_camera[3]));
  upload_frame();
  scene_buffers = scene.buffers();
  scene_buffers["corner_rays"] = &rays;
  scene_buffers["frame"] = &frame_buffer;
  scene_buffers["plate_samples"] = &plate.codes();
}

void Renderer::begin(FrameInput frame) {
  Impl& r = *impl_;
  if (!r.has_scene || !r.has_environment)
    throw Error("renderer: a frame was begun before the scene and the environment were set");
  r.take(std::move(frame));
  r.begin_accumulating();
  r.forget_samples();
  r.has_separate_parts = false;
  r.trees_before = std::exchange(r.trees_now, r.scene.rebuilt_trees());
  r.place();
  const std::uint32_t features = r.features = r.needed() | r.carried;
  if ((features & gpu::FEATURE_PHOTONS) != 0)
    r.wavefront->use_photons(r.photons(),
                             r.estimation.photon_radius_px / r.calibration.intrinsics.fx);
  r.wavefront->use_scene(r.scene_buffers, features);
  if ((features & gpu::FEATURE_CAMERA) != 0) r.wavefront->use_camera(r.radiance_of_codes());
  r.wavefront->clear();
}

void Renderer::render(int samples, const std::function<bool()>& cancelled) {
  Impl& r = *impl_;
  const bool whole =
      r.wavefront->render(static_cast<std::uint32_t>(r.first_sample + r.samples),
                          static_cast<std::uint32_t>(std::max(samples, 0)),
                          static_cast<std::uint32_t>(r.estimation.max_depth), cancelled);
  if (whole) {
    r.samples += samples;
  } else {
    r.wavefront->clear();
    r.forget_samples();
  }
}

void Renderer::start_at(std::int64_t sample) {
  assert(impl_->samples == 0);
  impl_->first_sample = sample;
}

SampleSums Renderer::take_sums() {
  Impl& r = *impl_;
  const PinholeIntrinsics& lens = r.calibration.intrinsics;
  SampleSums taken{lens.width, lens.height, r.samples, r.wavefront->keep()};
  r.wavefront->clear_sums();
  r.first_sample += std::exchange(r.samples, 0);
  return taken;
}

void Renderer::put_sums(const SampleSums& sums) {
  Impl& r = *impl_;
  assert(r.samples == 0);
  refuse_unfit(sums, r.calibration.intrinsics, (r.features & gpu::FEATURE_PHOTONS) != 0);
  r.wavefront->put_back(sums.sums);
  r.samples = sums.samples;
  r.first_sample = 0;
  add_samples_counted(r.counted_elsewhere, sums.counters);
}

void Renderer::wait() {
  impl_->device->submissions().finish();
}

std::optional<Layers> Renderer::pilot(int samples, const std::function<bool()>& cancelled) {
  Impl& r = *impl_;
  const std::optional<std::uint32_t> seed = r.frame.seed;
  r.frame.seed = ~seed.value_or(r.estimation.seed);
  r.upload_frame();
  render(samples, cancelled);
  std::optional<Layers> result;
  if (r.samples == samples) result = layers();
  r.frame.seed = seed;
  r.upload_frame();
  r.wavefront->clear();
  r.forget_samples();
  return result;
}

void Renderer::limit_samples(const std::vector<std::uint32_t>& limits) {
  std::vector<std::uint32_t> of_parts;
  for (const std::uint32_t limit : limits)
    of_parts.insert(of_parts.end(), gpu::SAMPLED_PARTS, limit);
  limit_parts(of_parts);
}

void Renderer::limit_parts(const std::vector<std::uint32_t>& limits) {
  impl_->wavefront->limit_samples(limits);
}

void Renderer::separate_parts() {
  impl_->has_separate_parts = true;
  impl_->upload_frame();
}

Layers Renderer::layers() const {
  Impl& r = *impl_;
  const PinholeIntrinsics& lens = r.calibration.intrinsics;
  const PlateRadiance plate = r.plate_radiance();
  Layers layers = make_layers(lens.width, lens.height, r.sampled(), r.device->scratch());
  layers.white = 1 / r.frame.exposure;
  for (const Wavefront::Sums& tile : r.wavefront->sums()) {
    const std::size_t first = static_cast<std::size_t>(tile.first_row) * lens.width;
    const std::size_t count = static_cast<std::size_t>(tile.rows) * lens.width;
    read<gpu::GpuPixel>(*r.device, tile.pixels, count, [&](std::span<const gpu::GpuPixel> pixels) {
      composite(layers, first, pixels, plate, r.rule());
    });
  }
  return layers;
}

const Plate& Renderer::plate() const {
  return impl_->codes();
}

ToPresent Renderer::Impl::to_present(bool denoise) {
  if (!denoiser) denoiser.emplace(*device);
  shown_by();
  const PinholeIntrinsics& lens = calibration.intrinsics;
  ToPresent what{wavefront->sums(),
                 lens.width,
                 lens.height,
                 wavefront->control_buffer(),
                 plate.codes(),
                 has_plate(),
                 is_clipped,
                 frame.exposure,
                 rule(),
                 sampled(),
                 denoise,
                 frame.dithers};
  if (frame.is_shown_whole) what.put_onto(plate.whole(), *frame.camera);
  return what;
}

Plate Renderer::show(bool denoise, Layers* layers) {
  Impl& r = *impl_;
  ToPresent what = r.to_present(denoise);
  std::optional<Plate> accumulated;
  if (r.frame.accumulates && r.samples > 0) {
    r.history->find_surfaces(r.scene_buffers, r.features, r.samples);
    what.history = &*r.history;
    accumulated = r.presenter->present(what, *r.denoiser);
    what.history = nullptr;
  }
  if (!denoise || !layers)
    return accumulated ? *std::move(accumulated) : r.presenter->present(what, *r.denoiser);
  const PlateRadiance plate = r.plate_radiance();
  Plate picture = r.presenter->present(what, *r.denoiser, [&](const Denoiser::Band& band) {
    r.denoiser->read(band, *layers, plate, r.rule());
  });
  layers->denoised = true;
  return accumulated ? *std::move(accumulated) : picture;
}

KeptFramePtr Renderer::keep() const {
  const Impl& r = *impl_;
  assert(r.samples > 0);
  const PinholeIntrinsics& lens = r.calibration.intrinsics;
  return std::make_shared<const KeptFrame>(KeptFrame{lens.width, lens.height, r.frame, r.samples,
                                                     r.features, r.scene.standing(), r.light,
                                                     r.wavefront->keep()});
}

// Makes a kept frame the current one again, as one that does not accumulate. The scene stands as it
// did. The rays that look for outlines get the set's seed, so that they are the same in all
// pictures, and outlines stand still.
void Renderer::Impl::put_back(const KeptFrame& kept) {
  const PinholeIntrinsics& lens = calibration.intrinsics;
  if (kept.width != lens.width || kept.height != lens.height)
    throw Error("renderer: a kept frame of " + std::to_string(kept.width) + "x" +
                std::to_string(kept.height) + " does not fit the calibration's " +
                std::to_string(lens.width) + "x" + std::to_string(lens.height));
  take(kept.frame);
  frame.accumulates = false;
  frame.seed.reset();
  counts_samples = false;
  past_samples = 0;
  forget_samples();
  samples = kept.samples;
  features = kept.features;
  scene.stand(kept.standing);
  trees_now = trees_before = scene.rebuilt_trees();
  place();
  wavefront->use_scene(scene_buffers, features);
  wavefront->put_back(kept.sums);
}

Plate Renderer::show_among(const std::vector<KeptFramePtr>& frames, bool denoise, Layers* layers) {
  Impl& r = *impl_;
  assert(!frames.empty());
  if (!r.history) r.history.emplace(*r.device);
  r.history->start_over();
  if (frames.size() == 1) {
    r.put_back(*frames.front());
    if (layers) *layers = this->layers();
    return show(denoise, layers);
  }
  const auto add = [&](const KeptFrame& kept) {
    r.put_back(kept);
    r.history->light_with(kept.light);
    r.history->light_with(r.scene.lamps());
    r.add_view();
    r.history->find_surfaces(r.scene_buffers, r.features, r.samples);
    ToPresent what = r.to_present(denoise);
    what.history = &*r.history;
    return what;
  };
  for (std::size_t i = 0; i + 1 < frames.size(); ++i) {
    const ToPresent what = add(*frames[i]);
    r.presenter->add_to_history(what, *r.denoiser);
  }
  const ToPresent what = add(*frames.back());
  if (layers) *layers = this->layers();
  const bool fills = denoise && layers;
  const PlateRadiance plate = fills ? r.plate_radiance() : PlateRadiance{};
  Plate picture = r.presenter->present(what, *r.denoiser, [&](const Denoiser::Band& band) {
    if (!fills) return;
    r.presenter->read(band, *layers);
    r.denoiser->read(band, *layers, plate, r.rule());
  });
  if (fills) layers->denoised = true;
  r.history->start_over();
  return picture;
}

// Returns what the computer counts; the device counts the rest.
Counters Renderer::Impl::host_counters() const {
  Counters counters;
  counters.rebuilt_trees = scene.rebuilt_trees() - trees_before;
  counters.encoded_lights = scene.encoded_lights();
  const GpuScene::Work& work = scene.work();
  counters.built_trees = work.trees;
  counters.uploaded_materials = work.materials;
  counters.uploaded_textures = work.textures;
  return counters;
}

Counters Renderer::counters() const {
  Counters counters = with(impl_->host_counters(), impl_->wavefront->control());
  add_samples_counted(counters, impl_->counted_elsewhere);
  return counters;
}

std::optional<CardIdentity> Renderer::card() const {
  return impl_->device->card();
}

DeviceWork Renderer::work() const {
  return work_of(*impl_->device);
}

DeviceTimes Renderer::take_times() {
  return render::take_times(*impl_->device);
}

Showing Renderer::show_later(bool denoise, const ShowTo& to) {
  Impl& r = *impl_;
  auto state = std::make_unique<Showing::State>();
  state->device = r.device;
  ToPresent what = r.to_present(denoise);
  if (r.frame.accumulates && r.samples > 0) {
    r.history->find_surfaces(r.scene_buffers, r.features, r.samples);
    what.history = &*r.history;
  }
  CardPictures::Lent lent;
  if (to.card) lent = r.on_card.lend(what.shown_width(), what.shown_height());
  state->on_card = std::move(lent.picture);
  if (to.computer || !state->on_card)
    state->picture = r.pictures.lend(what.shown_width(), what.shown_height(), r.response->bits());
  r.presenter->present_later(
      what, *r.denoiser,
      {.down = state->down, .plate = state->picture.get(), .on_card = lent.image});
  r.wavefront->count_into(state->control, state->down);
  state->host = r.host_counters();
  r.device->submissions().flush();
  return Showing(std::move(state));
}

}  // namespace previz::render
