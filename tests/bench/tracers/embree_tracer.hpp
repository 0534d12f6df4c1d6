// The same scene traced by Embree, one ray a call: what our traversal is compared with.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "drivers/embree.hpp"
#include "tests/bench/tracers/gpu_tracer.hpp"

namespace previz::bench {

class EmbreeTracer {
 public:
  // Instances become Embree instances with their presence as ray mask; `robust` asks Embree for
  // its watertight test.
  EmbreeTracer(const scene::Scene& scene, RTCBuildQuality quality, bool robust);

  TracedHit closest(const Ray& ray, std::uint32_t worlds) const;
  bool occluded(const Ray& ray, std::uint32_t worlds) const;

 private:
  template <typename Handle, void (*release)(Handle)>
  struct Release {
    using pointer = Handle;
    void operator()(Handle handle) const { release(handle); }
  };
  using Device = std::unique_ptr<RTCDevice, Release<RTCDevice, rtcReleaseDevice>>;
  using Scene = std::unique_ptr<RTCScene, Release<RTCScene, rtcReleaseScene>>;

  Scene new_scene(RTCBuildQuality quality, bool robust) const;

  Device device_;
  std::vector<Scene> meshes_;
  Scene scene_;
  std::vector<std::uint32_t> presence_;
  bool single_ = false;  // one instance that is not transformed: its mesh is traced directly
};

}  // namespace previz::bench
