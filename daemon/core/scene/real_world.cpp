#include "daemon/core/scene/real_world.hpp"

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace previz::scene {

// Deformations and animations name their instances by their places.
Scene real_world(Scene scene) {
  std::vector<Instance> kept;
  std::vector<std::optional<std::uint32_t>> place(scene.instances.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if ((scene.instances[i].presence & world_real) == 0) continue;
    place[i] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(std::move(scene.instances[i]));
  }
  scene.instances = std::move(kept);
  std::erase_if(scene.deformations,
                [&](const Deformation& deformation) { return !place[deformation.instance]; });
  for (Deformation& deformation : scene.deformations)
    deformation.instance = *place[deformation.instance];
  for (Animation& animation : scene.animations) {
    std::erase_if(animation.instances, [&](const auto& use) { return !place[use.what]; });
    for (auto& use : animation.instances) use.what = *place[use.what];
  }
  scene.variants.clear();  // they are of virtual objects
  return scene;
}

}  // namespace previz::scene
