// Puts a SceneState onto a scene: where everything is once the crew has moved and relit it.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::scene {

// A placement replaces Scene::instances and Scene::lights, and shapes the meshes that deform; no
// other mesh, material or texture depends on it.
struct Placement {
  std::vector<Instance> instances;
  std::vector<set::Light> lights;
  std::vector<Shape> shapes;  // of Scene::deformations, in their order
  // In plain words: names in the state that the set lacks, and what has no shape to be shown in.
  std::vector<std::string> unknown;
};

// `scene` is load_scene(set). An object takes its own lamps along. Whatever the state does not name
// stays as it was, bit for bit; whatever the state says is nowhere is in neither world. Gain
// and tint of a lamp apply to the mixed world only.
Placement place(const Scene& scene, const set::Set& set, const session::SceneState& state);

// Returns the lamp's state as the set has it, which changes nothing.
session::LightState state_of(const set::Light& light);

}  // namespace previz::scene
