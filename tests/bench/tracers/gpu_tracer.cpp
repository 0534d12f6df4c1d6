#include "tests/bench/tracers/gpu_tracer.hpp"

#include <algorithm>

#include "shaders/blocked_worlds.spv.h"
#include "shaders/blocked_worlds_query.spv.h"
#include "shaders/closest_distances.spv.h"
#include "shaders/closest_distances_query.spv.h"
#include "shaders/closest_hits.spv.h"
#include "shaders/closest_hits_query.spv.h"

namespace previz::bench {
namespace {

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
    : GpuTracer(device, texels, render::device_bits(device)) {}

GpuTracer::GpuTracer(render::Device& device, const std::vector<glm::uvec4>& texels,
                     std::uint32_t bits)
    : device_(device),
      hits_pass_(device, "closest_hits", closest_hits_spv, {0, bits}),
      distances_pass_(device, "closest_distances", closest_distances_spv, {0, bits}),
      blocked_pass_(device, "blocked_worlds", blocked_worlds_spv, {0, bits}),
      structures_(device) {
  const render::Purpose purpose{"the triangles' tree", "use fewer triangles"};
  render::upload_texels(device, purpose, bvh_, texels, vk::Format::eR32G32B32A32Uint);
}

GpuTracer::GpuTracer(render::Device& device, const scene::Scene& scene, scene::BvhQuality quality)
    : GpuTracer(device, scene_texels(scene, quality)) {
  if (!device.traces_in_hardware()) return;
  const std::uint32_t bits = render::device_bits(device);
  hits_pass_ = render::Kernel(device, "closest_hits", closest_hits_query_spv, {0, bits});
  distances_pass_ =
      render::Kernel(device, "closest_distances", closest_distances_query_spv, {0, bits});
  blocked_pass_ = render::Kernel(device, "blocked_worlds", blocked_worlds_query_spv, {0, bits});
  build_structures(scene);
}

// The vertices lie as the renderer has them.
void GpuTracer::build_structures(const scene::Scene& scene) {
  std::vector<glm::vec4> vertices;
  std::vector<render::RayStructures::Mesh> meshes;
  for (const scene::Mesh& from : scene.meshes) {
    meshes.push_back(render::RayStructures::mesh_of(
        from, static_cast<std::uint32_t>(vertices.size() / 2), false));
    for (const glm::vec3& position : from.positions)
      vertices.insert(vertices.end(), {glm::vec4(position, 0), glm::vec4(0)});
  }
  const render::Purpose purpose{"the vertices", "use fewer triangles"};
  render::Buffer buffer;
  render::upload_texels(device_, purpose, buffer, vertices, vk::Format::eR32G32B32A32Sfloat);
  structures_.build(meshes, buffer);
  std::vector<render::RayStructures::Instance> instances;
  for (const scene::Instance& instance : scene.instances)
    instances.push_back({.mesh = instance.mesh,
                         .presence = instance.presence,
                         .placed = instance.world_from_object});
  structures_.place(instances);
}

void GpuTracer::set_rays(std::span<const Ray> rays) {
  count_ = static_cast<std::uint32_t>(rays.size());
  const render::Purpose purpose{"the rays", "use fewer rays"};
  render::upload_texels(device_, purpose, rays_, std::vector<Ray>(rays.begin(), rays.end()),
                        vk::Format::eR32G32B32A32Sfloat);
  const vk::DeviceSize size = rays.size() * sizeof(TracedHit);
  if (!results_.buffer || results_.size < size)
    results_ = render::create_storage_buffer(device_, purpose, size);
}

void GpuTracer::dispatch(render::Kernel& pass, std::uint32_t worlds) {
  const render::Buffers buffers{{"bvh", &bvh_},           {"ray_structure", &structures_.top()},
                                {"rays", &rays_},         {"hits", &results_},
                                {"distances", &results_}, {"blocked", &results_}};
  const Batch batch{count_, worlds};
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    pass.dispatch({commands, batch, buffers}, count_);
  });
  device_.submissions().finish();
}

void GpuTracer::dispatch_distances(std::uint32_t worlds) {
  dispatch(distances_pass_, worlds);
}
void GpuTracer::dispatch_blocked(std::uint32_t worlds) {
  dispatch(blocked_pass_, worlds);
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
  dispatch(hits_pass_, worlds);
  return render::download<TracedHit>(device_, results_, rays.size());
}

std::vector<std::uint32_t> GpuTracer::blocked(std::span<const Ray> rays, std::uint32_t worlds) {
  if (rays.empty()) return {};
  set_rays(rays);
  dispatch_blocked(worlds);
  return blocked_worlds();
}

}  // namespace previz::bench
