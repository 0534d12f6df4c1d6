#include "daemon/render/wavefront.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/render/photon_schedule.hpp"
#include "shaders/accumulate.spv.h"
#include "shaders/advance.spv.h"
#include "shaders/extend.spv.h"
#include "shaders/generate.spv.h"
#include "shaders/prepare_shadow.spv.h"
#include "shaders/shade.spv.h"
#include "shaders/shadow.spv.h"

namespace previz::render {
namespace {

// Blocks of pixels in shaders/lib/path.glsl.
constexpr std::uint32_t block_width = 8;
constexpr std::uint32_t block_height = 4;

// Slots in flight: what stays near a CPU's caches; enough to fill a GPU.
constexpr std::uint32_t cpu_slots = 1u << 17;
constexpr std::uint32_t gpu_slots = 1u << 20;

// Metres. Photons are gathered over the square of the radius, which must not round to nothing.
constexpr double least_photon_radius = 1e-15;

std::uint32_t round_up(std::uint32_t value, std::uint32_t to) {
  return (value + to - 1) / to * to;
}

std::uint32_t slots_of(const gpu::GpuBatch& tile) {
  return round_up(tile.width, block_width) * round_up(tile.height, block_height);
}

std::uint32_t sampled_blocks(int pixels) {
  return (static_cast<std::uint32_t>(pixels) + gpu::SAMPLED_BLOCK - 1) / gpu::SAMPLED_BLOCK;
}

bool is_texel_buffer(std::uint32_t binding) {
  return binding < gpu::BINDING_INSTANCES;
}

}  // namespace

Wavefront::Wavefront(Device& device, int width, int height, std::uint32_t paths_a_slot)
    : device_(device),
      max_slots_(device.is_cpu() ? cpu_slots : gpu_slots),
      paths_a_slot_(paths_a_slot),
      width_(width),
      height_(height),
      photons_(device),
      camera_(device) {
  create_layouts();
  create_tiles(width, height);
  create_paths();
  for (const Tile& tile : tiles_) write_path_set(tile);
}

void Wavefront::create_layouts() {
  using Type = vk::DescriptorType;
  scene_layout_ = create_set_layout(device_, gpu::SCENE_BINDINGS, [](std::uint32_t binding) {
    return is_texel_buffer(binding) ? Type::eUniformTexelBuffer : Type::eStorageBuffer;
  });
  path_layout_ = create_set_layout(device_, gpu::PATH_BINDINGS,
                                   [](std::uint32_t) { return Type::eStorageBuffer; });
  const vk::DescriptorSetLayout layouts[] = {*scene_layout_, *path_layout_, *photons_.set_layout(),
                                             *camera_.set_layout()};
  const vk::PushConstantRange batch(vk::ShaderStageFlagBits::eCompute, 0, sizeof(gpu::GpuBatch));
  layout_ = vk::raii::PipelineLayout(device_.vk(), {{}, layouts, batch});
}

void Wavefront::create_tiles(int width, int height) {
  const auto columns = static_cast<std::uint32_t>(width);
  const auto rows = static_cast<std::uint32_t>(height);
  const std::uint32_t row_slots = round_up(columns, block_width) * block_height;
  const std::uint32_t most_rows = std::max(max_slots_ / row_slots * block_height, block_height);
  // Bands of equal height, so that none is left with a few rows.
  const std::uint32_t bands = (rows + most_rows - 1) / most_rows;
  const std::uint32_t band_rows = round_up((rows + bands - 1) / bands, block_height);
  for (std::uint32_t y = 0; y < rows; y += band_rows) {
    Tile tile;
    tile.batch = {0, y, columns, std::min(band_rows, rows - y), 0, 0, 0};
    tile.pixels = create_storage_buffer(
        device_, sizeof(gpu::GpuPixel) * tile.batch.width * tile.batch.height);
    tiles_.push_back(std::move(tile));
  }
  const auto sets = static_cast<std::uint32_t>(tiles_.size());
  const vk::DescriptorPoolSize sizes[] = {
      {vk::DescriptorType::eUniformTexelBuffer, gpu::SCENE_BINDINGS},
      {vk::DescriptorType::eStorageBuffer, gpu::SCENE_BINDINGS + sets * gpu::PATH_BINDINGS}};
  descriptors_ = vk::raii::DescriptorPool(
      device_.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, sets + 1, sizes});
  const auto allocate = [&](const vk::raii::DescriptorSetLayout& layout) {
    const vk::DescriptorSetLayout raw = *layout;
    return std::move(vk::raii::DescriptorSets(device_.vk(), {*descriptors_, raw}).front());
  };
  scene_set_ = allocate(scene_layout_);
  for (Tile& tile : tiles_) tile.set = allocate(path_layout_);
}

void Wavefront::create_paths() {
  for (const Tile& tile : tiles_) slots_ = std::max(slots_, slots_of(tile.batch));
  slots_ = std::max(slots_, max_slots_ / slots_ * slots_);
  const vk::DeviceSize paths = paths_a_slot_ * static_cast<vk::DeviceSize>(slots_);
  ray_origin_ = create_storage_buffer(device_, paths * sizeof(gpu::vec4));
  ray_direction_ = create_storage_buffer(device_, paths * sizeof(gpu::vec4));
  throughput_ = create_storage_buffer(device_, paths * sizeof(gpu::vec4));
  hits_ = create_storage_buffer(device_, paths * sizeof(gpu::GpuHit));
  queue_ = create_storage_buffer(device_, 2 * paths * sizeof(std::uint32_t));
  shadow_rays_ = create_storage_buffer(device_, paths * sizeof(gpu::GpuShadowRay));
  sample_mixed_ = create_storage_buffer(device_, slots_ * sizeof(gpu::vec4));
  sample_real_ = create_storage_buffer(device_, slots_ * sizeof(gpu::vec4));
  sample_landed_ =
      create_storage_buffer(device_, (paths_a_slot_ > 2 ? slots_ : 1) * sizeof(gpu::vec4));
  sample_aov_ = create_storage_buffer(device_, slots_ * sizeof(gpu::vec4));
  limits_ = create_storage_buffer(
      device_, sizeof(std::uint32_t) * sampled_blocks(width_) * sampled_blocks(height_));
  control_ = create_indirect_buffer(device_, sizeof(gpu::GpuControl));
}

void Wavefront::write_path_set(const Tile& tile) {
  std::vector<const Buffer*> buffers(gpu::PATH_BINDINGS);
  buffers[gpu::BINDING_RAY_ORIGIN] = &ray_origin_;
  buffers[gpu::BINDING_RAY_DIRECTION] = &ray_direction_;
  buffers[gpu::BINDING_THROUGHPUT] = &throughput_;
  buffers[gpu::BINDING_HIT] = &hits_;
  buffers[gpu::BINDING_QUEUE] = &queue_;
  buffers[gpu::BINDING_SHADOW] = &shadow_rays_;
  buffers[gpu::BINDING_SAMPLE_MIXED] = &sample_mixed_;
  buffers[gpu::BINDING_SAMPLE_REAL] = &sample_real_;
  buffers[gpu::BINDING_SAMPLE_AOV] = &sample_aov_;
  buffers[gpu::BINDING_SAMPLE_LANDED] = &sample_landed_;
  buffers[gpu::BINDING_CONTROL] = &control_;
  buffers[gpu::BINDING_PIXELS] = &tile.pixels;
  buffers[gpu::BINDING_LIMITS] = &limits_;
  for (std::uint32_t i = 0; i < gpu::PATH_BINDINGS; ++i)
    write_descriptor(device_, tile.set, i, *buffers[i], false);
}

void Wavefront::bind(const std::vector<const Buffer*>& scene, std::uint32_t features) {
  for (std::uint32_t i = 0; i < gpu::SCENE_BINDINGS; ++i)
    write_descriptor(device_, scene_set_, i, *scene[i], is_texel_buffer(i));
  if (!*generate_.pipeline || features != features_) create_pipelines(features);
}

void Wavefront::create_pipelines(std::uint32_t features) {
  const std::uint32_t constants[] = {features};
  generate_ = create_pipeline(device_, generate_spv, layout_, constants);
  advance_ = create_pipeline(device_, advance_spv, layout_, constants);
  extend_ = create_pipeline(device_, extend_spv, layout_, constants);
  shade_ = create_pipeline(device_, shade_spv, layout_, constants);
  prepare_shadow_ = create_pipeline(device_, prepare_shadow_spv, layout_, constants);
  shadow_ = create_pipeline(device_, shadow_spv, layout_, constants);
  accumulate_ = create_pipeline(device_, accumulate_spv, layout_, constants);
  if ((features & gpu::FEATURE_PHOTONS) != 0) photons_.create_pipelines(layout_, features);
  if ((features & gpu::FEATURE_CAMERA) != 0) camera_.create_pipelines(layout_, features);
  features_ = features;
}

void Wavefront::limit_samples(const std::vector<std::uint32_t>& limits) {
  upload_bytes(device_, limits_, std::as_bytes(std::span(limits)));
  sampled_until_ = limits;
  std::ranges::sort(sampled_until_);
  const std::size_t columns = sampled_blocks(width_);
  for (Tile& tile : tiles_) {
    const std::size_t first = tile.batch.y / gpu::SAMPLED_BLOCK;
    const std::size_t last = (tile.batch.y + tile.batch.height - 1) / gpu::SAMPLED_BLOCK;
    tile.limit =
        *std::max_element(limits.begin() + static_cast<std::ptrdiff_t>(first * columns),
                          limits.begin() + static_cast<std::ptrdiff_t>((last + 1) * columns));
  }
}

void Wavefront::clear() {
  limit_samples(std::vector<std::uint32_t>(
      std::size_t{sampled_blocks(width_)} * sampled_blocks(height_), gpu::UNLIMITED));
  photons_owed_ = 0;
  gpu::GpuControl control{};
  control.extend_groups[1] = control.extend_groups[2] = 1;
  control.shadow_groups[1] = control.shadow_groups[2] = 1;
  upload_bytes(device_, control_, std::as_bytes(std::span(&control, 1)));
  device_.submit([&](const vk::raii::CommandBuffer& commands) {
    for (const Tile& tile : tiles_) commands.fillBuffer(*tile.pixels.buffer, 0, VK_WHOLE_SIZE, 0);
    barrier(commands);
  });
}

void Wavefront::bind_sets(const vk::raii::CommandBuffer& commands, const Tile& tile,
                          const gpu::GpuBatch& batch) const {
  const vk::DescriptorSet sets[] = {*scene_set_, *tile.set, photons_.set(), camera_.set()};
  commands.bindDescriptorSets(vk::PipelineBindPoint::eCompute, *layout_, 0, sets, {});
  commands.pushConstants<gpu::GpuBatch>(*layout_, vk::ShaderStageFlagBits::eCompute, 0, batch);
}

// The queue that was filled becomes the active one, and each of its paths finds its next hit.
void Wavefront::record_extension(const vk::raii::CommandBuffer& commands) const {
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *advance_.pipeline);
  commands.dispatch(1, 1, 1);
  barrier(commands);
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *extend_.pipeline);
  commands.dispatchIndirect(*control_.buffer, offsetof(gpu::GpuControl, extend_groups));
  barrier(commands);
}

void Wavefront::record_batch(const vk::raii::CommandBuffer& commands, const Tile& tile,
                             const gpu::GpuBatch& batch, std::uint32_t max_depth) const {
  const auto use = [&](const Pipeline& pipeline) {
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
  };
  bind_sets(commands, tile, batch);
  use(generate_);
  commands.dispatch(work_groups(slots_of(batch) * batch.samples), 1, 1);
  barrier(commands);
  // One segment a vertex, one more to meet light after the last vertex, and one because a fork
  // goes on a round later than the path it parted from.
  for (std::uint32_t segment = 0; segment < max_depth + 2; ++segment) {
    record_extension(commands);
    use(shade_);
    commands.dispatchIndirect(*control_.buffer, offsetof(gpu::GpuControl, extend_groups));
    barrier(commands);
    use(prepare_shadow_);
    commands.dispatch(1, 1, 1);
    barrier(commands);
    use(shadow_);
    commands.dispatchIndirect(*control_.buffer, offsetof(gpu::GpuControl, shadow_groups));
    barrier(commands);
  }
  use(accumulate_);
  commands.dispatch(work_groups(batch.width * batch.height), 1, 1);
  barrier(commands);
}

// Photons are paths of their own, before those of the sample. A fork goes on a round later.
void Wavefront::record_photons(const vk::raii::CommandBuffer& commands,
                               std::uint32_t max_depth) const {
  photons_.record_emission(commands);
  for (std::uint32_t segment = 0; segment < max_depth + 1; ++segment) {
    record_extension(commands);
    photons_.bind_bounce(commands);
    commands.dispatchIndirect(*control_.buffer, offsetof(gpu::GpuControl, extend_groups));
    barrier(commands);
  }
  photons_.record_sorting(commands);
}

bool Wavefront::render(std::uint32_t first_sample, std::uint32_t samples, std::uint32_t max_depth,
                       const std::function<bool()>& cancelled) {
  if ((features_ & gpu::FEATURE_PHOTONS) != 0)
    return render_with_photons(first_sample, samples, max_depth, cancelled);
  for (const Tile& tile : tiles_) {
    const std::uint32_t at_once = std::max(slots_ / slots_of(tile.batch), 1u);
    const std::uint32_t end = std::min(first_sample + samples, tile.limit);
    for (std::uint32_t sample = first_sample; sample < end; sample += at_once) {
      if (cancelled && cancelled()) return false;
      gpu::GpuBatch batch = tile.batch;
      batch.first_sample = sample;
      batch.samples = std::min(at_once, end - sample);
      device_.submit([&](const vk::raii::CommandBuffer& commands) {
        record_batch(commands, tile, batch, max_depth);
      });
    }
  }
  return true;
}

// Of the picture's blocks, those that get the sample.
double Wavefront::share_of(std::uint32_t sample) const {
  const auto first = std::ranges::upper_bound(sampled_until_, sample);
  return static_cast<double>(sampled_until_.end() - first) /
         static_cast<double>(sampled_until_.size());
}

// Sample by sample: each has photons of its own, which all tiles share. They cost the same however
// few pixels look for them; so where a part of the picture is sampled, some samples share them. (As
// many as make up a whole picture would leave the last photons with most of the weight.)
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
    for (const Tile& tile : tiles_) {
      if (sample >= tile.limit) continue;
      if (cancelled && cancelled()) return false;
      gpu::GpuBatch batch = tile.batch;
      batch.first_sample = sample;
      batch.samples = 1;
      batch.photon_radius = static_cast<float>(traced_radius_);
      device_.submit([&](const vk::raii::CommandBuffer& commands) {
        if (trace_photons) {
          bind_sets(commands, tile, batch);
          record_photons(commands, max_depth);
        }
        record_batch(commands, tile, batch, max_depth);
      });
      trace_photons = false;
    }
  }
  return true;
}

void Wavefront::use_photons(std::uint32_t count, double radius) {
  photons_.resize(count);
  photon_radius_ = radius;
}

void Wavefront::use_camera(const std::vector<glm::vec4>& plate) {
  camera_.upload(plate);
  device_.submit([&](const vk::raii::CommandBuffer& commands) {
    bind_sets(commands, tiles_.front(), tiles_.front().batch);
    camera_.record(commands);
  });
}

std::vector<Wavefront::Sums> Wavefront::sums() const {
  std::vector<Sums> result;
  for (const Tile& tile : tiles_)
    result.push_back(
        {tile.pixels, static_cast<int>(tile.batch.y), static_cast<int>(tile.batch.height)});
  return result;
}

gpu::GpuControl Wavefront::control() const {
  return download<gpu::GpuControl>(device_, control_, 1).front();
}

}  // namespace previz::render
