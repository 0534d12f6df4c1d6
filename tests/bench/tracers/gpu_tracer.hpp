// Runs shaders/lib/trace.glsl on arrays of rays, for tests and benchmarks.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/world/ray_structures.hpp"
#include "daemon/core/scene/bvh.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::bench {

struct Ray {
  glm::vec3 origin{0};
  float t_min = 0;
  glm::vec3 direction{0, 0, 1};
  float t_max = 1e30f;
};

struct TracedHit {
  float t;  // < 0: nothing hit
  glm::vec2 barycentrics;
  std::uint32_t instance, primitive, presence;
};

// The texels that the shader reads: top level and meshes, as the renderer lays them out.
std::vector<glm::uvec4> scene_texels(const scene::Scene& scene, scene::BvhQuality quality);
std::vector<glm::uvec4> scene_texels(const scene::Scene& scene,
                                     std::span<const scene::MeshBvh> meshes);

class GpuTracer {
 public:
  // Traces as the renderer does on this device, or as on one with these DEVICE_* bits.
  GpuTracer(render::Device& device, const std::vector<glm::uvec4>& texels);
  GpuTracer(render::Device& device, const std::vector<glm::uvec4>& texels, std::uint32_t bits);
  // Traces the scene in hardware if the device does so, otherwise as above.
  GpuTracer(render::Device& device, const scene::Scene& scene, scene::BvhQuality quality);

  std::vector<TracedHit> closest(std::span<const Ray> rays, std::uint32_t worlds);
  std::vector<std::uint32_t> blocked(std::span<const Ray> rays, std::uint32_t worlds);

  // For benchmarks: the rays stay, a dispatch is timed by its caller.
  void set_rays(std::span<const Ray> rays);
  void dispatch_distances(std::uint32_t worlds);
  void dispatch_blocked(std::uint32_t worlds);
  std::vector<float> distances();               // of the last dispatch_distances; < 0: nothing hit
  std::vector<std::uint32_t> blocked_worlds();  // of the last dispatch_blocked

 private:
  void dispatch(render::Kernel& pass, std::uint32_t worlds);
  void build_structures(const scene::Scene& scene);

  render::Device& device_;
  render::Kernel hits_pass_, distances_pass_, blocked_pass_;
  render::Buffer bvh_, rays_, results_;
  render::RayStructures structures_;
  std::uint32_t count_ = 0;
};

}  // namespace previz::bench
