#include "tests/bench/tracers/gpu_tracer.hpp"

#include <algorithm>
#include <array>

#include "shaders/blocked_worlds.spv.h"
#include "shaders/closest_distances.spv.h"
#include "shaders/closest_hits.spv.h"
#include "shaders/lib/shared.h"

namespace previz::bench {
namespace {

constexpr std::uint32_t group_size = 64;
constexpr std::uint32_t binding_rays = 1, binding_results = 2;

struct Batch {
  std::uint32_t count, worlds;
};

static_assert(sizeof(Ray) == 32);
static_assert(sizeof(TracedHit) == 24);

}  // namespace

std::vector<glm::uvec4> scene_texels(const scene::Scene& scene,
                                     std::span<const scene::MeshBvh> meshes) {
  std::vector<glm::uvec4> texels(scene::top_bvh_texels(scene.instances.size()));
  std::vector<std::uint32_t> first_record;
  for (const scene::MeshBvh& mesh : meshes) {
    first_record.push_back(static_cast<std::uint32_t>(texels.size() / scene::texels_per_record));
    texels.insert(texels.end(), mesh.texels.begin(), mesh.texels.end());
  }
  std::vector<scene::TopInstance> instances;
  for (const scene::Instance& instance : scene.instances)
    instances.push_back({&meshes[instance.mesh], first_record[instance.mesh], instance.presence,
                         instance.world_from_object});
  const scene::TopBvh top = scene::build_top_bvh(instances);
  std::copy(top.texels.begin(), top.texels.end(), texels.begin());
  return texels;
}

std::vector<glm::uvec4> scene_texels(const scene::Scene& scene, scene::BvhQuality quality) {
  std::vector<scene::MeshBvh> meshes;
  for (const scene::Mesh& mesh : scene.meshes)
    meshes.push_back(scene::build_mesh_bvh(mesh, quality));
  return scene_texels(scene, meshes);
}

GpuTracer::GpuTracer(render::Device& device, const std::vector<glm::uvec4>& texels)
    : device_(device) {
  using Type = vk::DescriptorType;
  const auto compute = vk::ShaderStageFlagBits::eCompute;
  const std::array bindings{
      vk::DescriptorSetLayoutBinding(gpu::BINDING_BVH, Type::eUniformTexelBuffer, 1, compute),
      vk::DescriptorSetLayoutBinding(binding_rays, Type::eUniformTexelBuffer, 1, compute),
      vk::DescriptorSetLayoutBinding(binding_results, Type::eStorageBuffer, 1, compute)};
  set_layout_ = vk::raii::DescriptorSetLayout(device.vk(), {{}, bindings});
  const vk::PushConstantRange push(compute, 0, sizeof(Batch));
  layout_ = vk::raii::PipelineLayout(device.vk(), {{}, *set_layout_, push});
  const std::array sizes{vk::DescriptorPoolSize(Type::eUniformTexelBuffer, 2),
                         vk::DescriptorPoolSize(Type::eStorageBuffer, 1)};
  pool_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, sizes});
  set_ = std::move(vk::raii::DescriptorSets(device.vk(), {*pool_, *set_layout_}).front());
  hits_pipeline_ = render::create_pipeline(device, closest_hits_spv, layout_, {});
  distances_pipeline_ = render::create_pipeline(device, closest_distances_spv, layout_, {});
  blocked_pipeline_ = render::create_pipeline(device, blocked_worlds_spv, layout_, {});
  render::upload_texels(device, bvh_, texels, vk::Format::eR32G32B32A32Uint);
}

void GpuTracer::set_rays(std::span<const Ray> rays) {
  count_ = static_cast<std::uint32_t>(rays.size());
  render::upload_texels(device_, rays_, std::vector<Ray>(rays.begin(), rays.end()),
                        vk::Format::eR32G32B32A32Sfloat);
  const vk::DeviceSize size = rays.size() * sizeof(TracedHit);
  if (!*results_.buffer || results_.size < size)
    results_ = render::create_storage_buffer(device_, size);
  bind();
}

void GpuTracer::bind() {
  const vk::DescriptorBufferInfo results(*results_.buffer, 0, VK_WHOLE_SIZE);
  const vk::BufferView bvh = *bvh_.view;
  const vk::BufferView rays = *rays_.view;
  using Type = vk::DescriptorType;
  const std::array writes{
      vk::WriteDescriptorSet(*set_, gpu::BINDING_BVH, 0, 1, Type::eUniformTexelBuffer, nullptr,
                             nullptr, &bvh),
      vk::WriteDescriptorSet(*set_, binding_rays, 0, 1, Type::eUniformTexelBuffer, nullptr, nullptr,
                             &rays),
      vk::WriteDescriptorSet(*set_, binding_results, 0, 1, Type::eStorageBuffer, nullptr,
                             &results)};
  device_.vk().updateDescriptorSets(writes, nullptr);
}

void GpuTracer::dispatch(const render::Pipeline& pipeline, std::uint32_t worlds) {
  device_.submit([&](const vk::raii::CommandBuffer& commands) {
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
    commands.bindDescriptorSets(vk::PipelineBindPoint::eCompute, *layout_, 0, *set_, nullptr);
    commands.pushConstants<Batch>(*layout_, vk::ShaderStageFlagBits::eCompute, 0,
                                  Batch{count_, worlds});
    commands.dispatch((count_ + group_size - 1) / group_size, 1, 1);
    render::barrier(commands);
  });
}

void GpuTracer::dispatch_distances(std::uint32_t worlds) {
  dispatch(distances_pipeline_, worlds);
}
void GpuTracer::dispatch_blocked(std::uint32_t worlds) {
  dispatch(blocked_pipeline_, worlds);
}

std::vector<float> GpuTracer::distances() {
  const auto pairs = render::download<glm::vec2>(device_, results_, count_);
  std::vector<float> result;
  for (const glm::vec2& pair : pairs) result.push_back(pair.x);
  return result;
}

std::vector<std::uint32_t> GpuTracer::blocked_worlds() {
  return render::download<std::uint32_t>(device_, results_, count_);
}

std::vector<TracedHit> GpuTracer::closest(std::span<const Ray> rays, std::uint32_t worlds) {
  if (rays.empty()) return {};
  set_rays(rays);
  dispatch(hits_pipeline_, worlds);
  return render::download<TracedHit>(device_, results_, rays.size());
}

std::vector<std::uint32_t> GpuTracer::blocked(std::span<const Ray> rays, std::uint32_t worlds) {
  if (rays.empty()) return {};
  set_rays(rays);
  dispatch_blocked(worlds);
  return blocked_worlds();
}

}  // namespace previz::bench
