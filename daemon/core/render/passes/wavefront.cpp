#include "daemon/core/render/passes/wavefront.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <span>
#include <utility>

#include "daemon/core/render/passes/photon_schedule.hpp"
#include "shaders/accumulate.spv.h"
#include "shaders/advance.spv.h"
#include "shaders/extend.spv.h"
#include "shaders/extend_query.spv.h"
#include "shaders/generate.spv.h"
#include "shaders/prepare_shadow.spv.h"
#include "shaders/shade.spv.h"
#include "shaders/shadow.spv.h"
#include "shaders/shadow_query.spv.h"

namespace previz::render {
namespace {

// The size of the blocks of pixels in shaders/lib/path.glsl.
constexpr std::uint32_t block_width = 8;
constexpr std::uint32_t block_height = 4;

// The number of slots in flight: on a CPU few enough to stay near its caches, on a GPU enough to
// fill it.
constexpr std::uint32_t cpu_slots = 1u << 17;
constexpr std::uint32_t gpu_slots = 1u << 20;

// The least and the largest radius over the distance from the camera. Photons are gathered over the
// square of the radius, which must not round to zero; a disc that reached the camera itself would
// have no place in the grid.
constexpr double least_photon_radius = 1e-15, most_photon_radius = 0.5;

constexpr Pass path_passes[] = {{"generate", generate_spv},
                                {"advance", advance_spv},
                                {"extend", extend_spv, extend_query_spv},
                                {"prepare_shadow", prepare_shadow_spv},
                                {"shadow", shadow_spv, shadow_query_spv},
                                {"accumulate", accumulate_spv}};

// A card shades in parts: see shade.comp.
std::vector<Pass> shade_passes(std::uint32_t device) {
  if ((device & gpu::DEVICE_IS_CARD) == 0) return {{"shade", shade_spv, {}, gpu::SHADE_ALL}};
  return {{"shade_receive", shade_spv, {}, gpu::SHADE_RECEIVE},
          {"shade_light", shade_spv, {}, gpu::SHADE_LIGHT},
          {"shade_scatter", shade_spv, {}, gpu::SHADE_SCATTER}};
}

std::uint32_t round_up(std::uint32_t value, std::uint32_t to) {
  return (value + to - 1) / to * to;
}

std::uint32_t slots_of(const gpu::GpuBatch& tile) {
  return round_up(tile.width, block_width) * round_up(tile.height, block_height);
}

// Returns how many slots are in flight: as many as suit the device, and few enough that the largest
// array with an element for each slot, path, pixel or photon is no larger than a storage buffer may
// be.
std::uint32_t most_slots(const Device& device, std::uint32_t paths_a_slot) {
  const std::size_t a_path = gpu::SHADOW_RAY_TEXELS * sizeof(gpu::uvec2);  // the largest
  const std::size_t a_slot =
      std::max(std::max(sizeof(gpu::GpuPixel), sizeof(gpu::GpuPhoton)), paths_a_slot * a_path);
  const std::size_t allowed = device.limits().maxStorageBufferRange / a_slot;
  const std::size_t suited = device.shares_host_memory() ? cpu_slots : gpu_slots;
  return static_cast<std::uint32_t>(std::min(suited, allowed));
}

std::uint32_t sampled_blocks(int pixels) {
  return (static_cast<std::uint32_t>(pixels) + gpu::SAMPLED_BLOCK - 1) / gpu::SAMPLED_BLOCK;
}

}  // namespace

Wavefront::Wavefront(Device& device, int width, int height, std::uint32_t paths_a_slot)
    : device_(device),
      max_slots_(most_slots(device, paths_a_slot)),
      paths_a_slot_(paths_a_slot),
      photons_(device),
      camera_(device) {
  const Purpose purpose{"the counters of paths", "close other programs"};
  control_ = create_indirect_buffer(device, purpose, sizeof(gpu::GpuControl));
  resize(width, height);
}

Purpose Wavefront::for_paths() const {
  return {"the paths", "make the picture smaller", width_, height_};
}

void Wavefront::resize(int width, int height) {
  width_ = width;
  height_ = height;
  create_tiles();
  create_paths();
}

vk::DeviceSize Wavefront::bytes_of(const Tile& tile) const {
  return sizeof(gpu::GpuPixel) * vk::DeviceSize{tile.batch.width} * tile.batch.height;
}

// The bands have equal height, so that none is left with a few rows. There are as few as the slots
// allow, or more if each of them then fits into the buffers that are there.
void Wavefront::create_tiles() {
  const auto columns = static_cast<std::uint32_t>(width_);
  const auto rows = static_cast<std::uint32_t>(height_);
  const auto divide = [&](std::uint32_t bands) {
    const std::uint32_t band_rows = round_up((rows + bands - 1) / bands, block_height);
    tiles_.clear();
    for (std::uint32_t y = 0; y < rows; y += band_rows)
      tiles_.push_back({{0, y, columns, std::min(band_rows, rows - y), 0, 0, 0, 0}});
  };
  const auto fits = [&] {
    for (std::size_t i = 0; i < tiles_.size(); ++i)
      if (i >= pixels_.size() || pixels_[i].size < bytes_of(tiles_[i])) return false;
    return true;
  };
  const std::uint32_t row_slots = round_up(columns, block_width) * block_height;
  const std::uint32_t most_rows = std::max(max_slots_ / row_slots * block_height, block_height);
  const std::uint32_t fewest = (rows + most_rows - 1) / most_rows;
  std::uint32_t bands = fewest;
  for (divide(bands); !fits() && bands < pixels_.size();) divide(++bands);
  if (fits()) return;
  divide(fewest);
  pixels_.clear();  // frees the old memory before the new is allocated
  for (const Tile& tile : tiles_)
    pixels_.push_back(create_picture_buffer(device_, for_paths(), bytes_of(tile)));
}

void Wavefront::create_paths() {
  const vk::DeviceSize limits = sizeof(std::uint32_t) * gpu::SAMPLED_PARTS *
                                sampled_blocks(width_) * vk::DeviceSize{sampled_blocks(height_)};
  if (limits_.size < limits) limits_ = create_storage_buffer(device_, for_paths(), limits);
  std::uint32_t most = 0;
  for (const Tile& tile : tiles_) most = std::max(most, slots_of(tile.batch));
  const std::uint32_t slots = std::max(most, max_slots_ / most * most);
  if (most > slots_) create_path_buffers(slots);
  most_photons_ = std::min(slots, slots_);
}

void Wavefront::create_path_buffers(std::uint32_t slots) {
  slots_ = 0;  // stays 0 if an allocation below throws
  const vk::DeviceSize paths = paths_a_slot_ * static_cast<vk::DeviceSize>(slots);
  for (Buffer* old : {&ray_origin_, &ray_direction_, &throughput_, &receivers_, &hits_, &queue_,
                      &shadow_rays_, &sample_mixed_, &sample_real_, &sample_landed_, &sample_aov_,
                      &sample_albedo_, &sample_caustic_})
    *old = Buffer{};  // frees the old memory before the new is allocated
  const auto create_state = [&](vk::DeviceSize count, vk::DeviceSize size, vk::Format format) {
    return create_texel_buffer(device_, for_paths(), count * size, format, /*is_storage=*/true);
  };
  ray_origin_ = create_state(paths, sizeof(gpu::vec4), vk::Format::eR32G32B32A32Sfloat);
  ray_direction_ = create_state(paths, sizeof(gpu::vec4), vk::Format::eR32G32B32A32Sfloat);
  throughput_ = create_state(paths, sizeof(gpu::GpuThroughput), vk::Format::eR32G32B32A32Uint);
  receivers_ = create_state(paths, sizeof(std::uint32_t), vk::Format::eR32Uint);
  hits_ = create_state(paths, gpu::HIT_TEXELS * sizeof(gpu::uvec2), vk::Format::eR32G32Uint);
  queue_ = create_state(2 * paths, sizeof(std::uint32_t), vk::Format::eR32Uint);
  shadow_rays_ =
      create_state(paths, gpu::SHADOW_RAY_TEXELS * sizeof(gpu::uvec2), vk::Format::eR32G32Uint);
  sample_mixed_ = create_storage_buffer(device_, for_paths(), slots * sizeof(gpu::vec4));
  sample_real_ = create_storage_buffer(device_, for_paths(), slots * sizeof(gpu::vec4));
  sample_landed_ = create_storage_buffer(device_, for_paths(),
                                         (paths_a_slot_ > 2 ? slots : 1) * sizeof(gpu::vec4));
  sample_aov_ = create_storage_buffer(device_, for_paths(), slots * sizeof(gpu::vec4));
  sample_albedo_ = create_storage_buffer(device_, for_paths(), slots * sizeof(gpu::uvec2));
  slots_ = slots;
}

Buffers Wavefront::buffers_of(std::size_t tile) const {
  Buffers buffers = scene_;
  buffers.insert({{"ray_origin", &ray_origin_},
                  {"ray_direction", &ray_direction_},
                  {"path_throughput", &throughput_},
                  {"path_receiver", &receivers_},
                  {"hits", &hits_},
                  {"queue", &queue_},
                  {"shadow_rays", &shadow_rays_},
                  {"sample_mixed", &sample_mixed_},
                  {"sample_real", &sample_real_},
                  {"sample_landed", &sample_landed_},
                  {"sample_aov", &sample_aov_},
                  {"sample_albedo", &sample_albedo_},
                  {"sample_caustic", &sample_caustic_},
                  {"control", &control_},
                  {"limits", &limits_},
                  {"pixels", &pixels_[tile]},
                  {"pixel_caustics", &caustics_[tile]}});
  photons_.add_to(buffers);
  camera_.add_to(buffers);
  return buffers;
}

// Makes room for the light of photons, or for nothing where there is none.
void Wavefront::create_caustics(bool has_photons) {
  const Purpose purpose{"the light of photons",
                        "make the picture smaller, or set estimator.caustics to \"none\"", width_,
                        height_};
  const vk::DeviceSize slots = has_photons ? 2 * vk::DeviceSize{slots_} : 1;
  if (sample_caustic_.size < slots * sizeof(gpu::vec4))
    sample_caustic_ = create_storage_buffer(device_, for_paths(), slots * sizeof(gpu::vec4));
  caustics_.resize(pixels_.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const vk::DeviceSize pixels = has_photons ? pixels_[i].size / sizeof(gpu::GpuPixel) : 1;
    if (caustics_[i].size < pixels * sizeof(gpu::vec4))
      caustics_[i] = create_picture_buffer(device_, purpose, pixels * sizeof(gpu::vec4));
  }
}

void Wavefront::use_scene(Buffers scene, std::uint32_t features) {
  scene_ = std::move(scene);
  create_caustics((features & gpu::FEATURE_PHOTONS) != 0);
  if (features != features_) create_kernels(features);
}

std::vector<Pass> Wavefront::passes_for(std::uint32_t features, std::uint32_t device) {
  std::vector<Pass> passes(std::begin(path_passes), std::end(path_passes));
  const auto add = [&](std::span<const Pass> more) {
    passes.insert(passes.end(), more.begin(), more.end());
  };
  add(shade_passes(device));
  if ((features & gpu::FEATURE_PHOTONS) != 0) add(PhotonMap::passes());
  if ((features & gpu::FEATURE_CAMERA) != 0) add(CameraMap::passes());
  return passes;
}

void Wavefront::create_kernels(std::uint32_t features) {
  features_.reset();  // stays empty if creating a kernel throws
  make_kernels({&generate_, &advance_, &extend_, &prepare_shadow_, &shadow_, &accumulate_}, device_,
               path_passes, features);
  shade_.clear();
  for (const Pass& pass : shade_passes(device_bits(device_)))
    shade_.emplace_back(device_, pass, features);
  if ((features & gpu::FEATURE_PHOTONS) != 0) photons_.create_kernels(features);
  if ((features & gpu::FEATURE_CAMERA) != 0) camera_.create_kernels(features);
  features_ = features;
}

void Wavefront::limit_samples(const std::vector<std::uint32_t>& limits) {
  upload_bytes(device_, limits_, std::as_bytes(std::span(limits)));
  sampled_until_ = limits;
  std::ranges::sort(sampled_until_);
  const std::size_t columns = std::size_t{gpu::SAMPLED_PARTS} * sampled_blocks(width_);
  for (Tile& tile : tiles_) {
    const std::size_t first = tile.batch.y / gpu::SAMPLED_BLOCK;
    const std::size_t last = (tile.batch.y + tile.batch.height - 1) / gpu::SAMPLED_BLOCK;
    tile.limit =
        *std::max_element(limits.begin() + static_cast<std::ptrdiff_t>(first * columns),
                          limits.begin() + static_cast<std::ptrdiff_t>((last + 1) * columns));
  }
}

void Wavefront::clear() {
  sampled_until_ = {gpu::UNLIMITED};
  for (Tile& tile : tiles_) tile.limit = gpu::UNLIMITED;
  photons_owed_ = 0;
  gpu::GpuControl control{};
  control.extend_groups[1] = control.extend_groups[2] = 1;
  control.shadow_groups[1] = control.shadow_groups[2] = 1;
  upload_bytes(device_, control_, std::as_bytes(std::span(&control, 1)));
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    commands.fillBuffer(limits_.buffer, 0, VK_WHOLE_SIZE, gpu::UNLIMITED);
    record_clear_sums(commands);
  });
  count();
}

void Wavefront::clear_sums() {
  device_.record([&](const vk::raii::CommandBuffer& commands) { record_clear_sums(commands); });
}

void Wavefront::record_clear_sums(const vk::raii::CommandBuffer& commands) {
  for (std::size_t i = 0; i < tiles_.size(); ++i)
    record_clear(device_, commands, pixels_[i], bytes_of(tiles_[i]));
  for (const Buffer& caustics : caustics_) record_clear(device_, commands, caustics, caustics.size);
}

// The queue that was filled becomes the active one, and each of its paths finds its next hit.
void Wavefront::record_extension(const Recording& recording) {
  advance_.dispatch(recording, 1);
  extend_.dispatch_indirect(recording, control_, offsetof(gpu::GpuControl, extend_groups));
}

std::uint32_t Wavefront::passes() const {
  return (features_.value() & gpu::FEATURE_PANES) != 0 ? gpu::MOST_PASSES : 0;
}

void Wavefront::record_batch(const Recording& recording, const gpu::GpuBatch& batch,
                             std::uint32_t max_depth) {
  generate_.dispatch(recording, slots_of(batch) * batch.samples);
  // There is one segment per vertex, one more to meet light after the last vertex, one for each
  // pane that a path meets and passes, and one for each fork, because the half that parts continues
  // one round later. A path forks once, and once more where it can take the camera's radiance.
  const bool by_camera = (features_.value() & gpu::FEATURE_CAMERA) != 0;
  const std::uint32_t segments = max_depth + (by_camera ? 3 : 2) + passes();
  for (std::uint32_t segment = 0; segment < segments; ++segment) {
    record_extension(recording);
    for (Kernel& shade : shade_)
      shade.dispatch_indirect(recording, control_, offsetof(gpu::GpuControl, extend_groups));
    prepare_shadow_.dispatch(recording, 1);
    shadow_.dispatch_indirect(recording, control_, offsetof(gpu::GpuControl, shadow_groups));
  }
  accumulate_.dispatch(recording, batch.width * batch.height);
}

// Photons are paths of their own, traced before those of the sample. Here too a fork continues one
// round later, and so does what passes a pane.
void Wavefront::record_photons(const vk::raii::CommandBuffer& commands, const gpu::GpuBatch& batch,
                               const Buffers& buffers, std::uint32_t max_depth) {
  const Recording recording{commands, batch, buffers};
  photons_.record_emission(recording);
  for (std::uint32_t segment = 0; segment < max_depth + 1 + passes(); ++segment) {
    record_extension(recording);
    photons_.record_bounce(recording, control_, offsetof(gpu::GpuControl, extend_groups));
  }
  photons_.record_sorting(commands, batch, buffers);
}

bool Wavefront::render(std::uint32_t first_sample, std::uint32_t samples, std::uint32_t max_depth,
                       const std::function<bool()>& cancelled) {
  if ((features_.value() & gpu::FEATURE_PHOTONS) != 0)
    return render_with_photons(first_sample, samples, max_depth, cancelled);
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    const Tile& tile = tiles_[i];
    const Buffers buffers = buffers_of(i);
    const std::uint32_t at_once = std::max(slots_ / slots_of(tile.batch), 1u);
    const std::uint32_t end = std::min(first_sample + samples, tile.limit);
    for (std::uint32_t sample = first_sample; sample < end; sample += at_once) {
      if (cancelled && cancelled()) return false;
      gpu::GpuBatch batch = tile.batch;
      batch.first_sample = sample;
      batch.samples = std::min(at_once, end - sample);
      device_.record([&](const vk::raii::CommandBuffer& commands) {
        record_batch({commands, batch, buffers}, batch, max_depth);
      });
      device_.submissions().add_work(slots_of(batch) * std::uint64_t{batch.samples});
    }
  }
  count();
  return true;
}

// Returns the share of the parts of the picture's blocks that get the sample.
double Wavefront::share_of(std::uint32_t sample) const {
  const auto first = std::ranges::upper_bound(sampled_until_, sample);
  return static_cast<double>(sampled_until_.end() - first) /
         static_cast<double>(sampled_until_.size());
}

// Renders sample by sample, since each sample has photons of its own, which all tiles share.
// Photons cost the same however few pixels gather them, so where only a part of the picture is
// still sampled, some samples share photons. (If a full picture's worth of samples shared them, the
// last photons would carry most of the weight.)
bool Wavefront::render_with_photons(std::uint32_t first_sample, std::uint32_t samples,
                                    std::uint32_t max_depth,
                                    const std::function<bool()>& cancelled) {
  for (std::uint32_t sample = first_sample; sample < first_sample + samples; ++sample) {
    photons_owed_ += std::sqrt(share_of(sample));
    bool trace_photons = photons_owed_ >= 1;
    if (trace_photons) {
      photons_owed_ -= 1;
      traced_radius_ = std::max(photon_radius_ * photon_radius_factor(sample), least_photon_radius);
    }
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      const Tile& tile = tiles_[i];
      if (sample >= tile.limit) continue;
      if (cancelled && cancelled()) return false;
      gpu::GpuBatch batch = tile.batch;
      batch.first_sample = sample;
      batch.samples = 1;
      batch.photon_radius = static_cast<float>(traced_radius_);
      const Buffers buffers = buffers_of(i);
      device_.record([&](const vk::raii::CommandBuffer& commands) {
        if (trace_photons) record_photons(commands, batch, buffers, max_depth);
        record_batch({commands, batch, buffers}, batch, max_depth);
      });
      device_.submissions().add_work(slots_of(batch) +
                                     (trace_photons ? std::uint64_t{photons_.count()} : 0));
      trace_photons = false;
    }
  }
  count();
  return true;
}

void Wavefront::use_photons(std::uint32_t count, double radius) {
  photons_.resize(count);
  photon_radius_ = std::min(radius, most_photon_radius);
}

void Wavefront::use_camera(const std::vector<float>& radiance_of_codes) {
  camera_.use(static_cast<std::uint32_t>(width_) * static_cast<std::uint32_t>(height_),
              radiance_of_codes);
  const Buffers buffers = buffers_of(0);
  std::vector<gpu::GpuBatch> parts;
  for (const Tile& tile : tiles_) parts.push_back(tile.batch);
  device_.record(
      [&](const vk::raii::CommandBuffer& commands) { camera_.record(commands, parts, buffers); });
}

std::vector<Wavefront::Sums> Wavefront::sums() const {
  const bool has_photons = (features_.value_or(0) & gpu::FEATURE_PHOTONS) != 0;
  std::vector<Sums> result;
  for (std::size_t i = 0; i < tiles_.size(); ++i)
    result.push_back({pixels_[i], static_cast<int>(tiles_[i].batch.y),
                      static_cast<int>(tiles_[i].batch.height),
                      has_photons ? &caustics_[i] : nullptr});
  return result;
}

PixelSums Wavefront::keep() const {
  const auto width = static_cast<std::size_t>(width_);
  const std::vector<Sums> tiles = sums();
  PixelSums kept(device_.scratch());
  kept.pixels.resize(width * static_cast<std::size_t>(height_));
  if (tiles.front().caustics) kept.caustics.resize(kept.pixels.size());
  for (const Sums& tile : tiles) {
    const std::size_t first = static_cast<std::size_t>(tile.first_row) * width;
    const std::size_t count = static_cast<std::size_t>(tile.rows) * width;
    download_bytes(device_, tile.pixels,
                   std::as_writable_bytes(std::span(kept.pixels).subspan(first, count)));
    if (tile.caustics)
      download_bytes(device_, *tile.caustics,
                     std::as_writable_bytes(std::span(kept.caustics).subspan(first, count)));
  }
  return kept;
}

void Wavefront::put_back(const PixelSums& kept) {
  const auto width = static_cast<std::size_t>(width_);
  const bool has_photons = (features_.value() & gpu::FEATURE_PHOTONS) != 0;
  assert(kept.pixels.size() == width * static_cast<std::size_t>(height_));
  assert(has_photons == !kept.caustics.empty());
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    const std::size_t first = tiles_[i].batch.y * width;
    const std::size_t count = tiles_[i].batch.height * width;
    upload_bytes(device_, pixels_[i], std::as_bytes(std::span(kept.pixels).subspan(first, count)));
    if (has_photons)
      upload_bytes(device_, caustics_[i],
                   std::as_bytes(std::span(kept.caustics).subspan(first, count)));
  }
}

// What was counted comes down with what is recorded next, so that control() need not ask for it.
void Wavefront::count() {
  count_into(counted_, counted_down_);
}

void Wavefront::count_into(gpu::GpuControl& counted, Downloads& down) const {
  down.add(device_, control_, std::as_writable_bytes(std::span(&counted, 1)));
}

gpu::GpuControl Wavefront::control() {
  counted_down_.finish();
  return counted_;
}

}  // namespace previz::render
