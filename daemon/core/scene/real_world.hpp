// Takes what is not real out of a scene.
#pragma once

#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// Returns the scene as it is without virtual objects: phantoms and removed objects, and what moves
// and deforms them. Meshes, materials and lamps stay.
Scene real_world(Scene scene);

}  // namespace previz::scene
