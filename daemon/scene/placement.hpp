// Where everything is once the crew has moved and relit it: a scene with a SceneState put onto it.
#pragma once

#include <string>
#include <vector>

#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"
#include "drivers/session/session.hpp"

namespace previz::scene {

// Stands in for Scene::instances and Scene::lights; no mesh, material or texture depends on it.
struct Placement {
  std::vector<Instance> instances;
  std::vector<set::Light> lights;
  std::vector<std::string> unknown;  // names of the state that the set has not, in plain words
};

// `scene` is load_scene(set). An object takes its own lamps along. What the state does not name is
// bit for bit as it was; what it says is nowhere is in neither world. A tint is of the mixed world
// only: a lamp that also shines in the real one is split in two.
Placement place(const Scene& scene, const set::Set& set, const session::SceneState& state);

// The lamp as the set has it: a state that changes nothing.
session::LightState state_of(const set::Light& light);

}  // namespace previz::scene
