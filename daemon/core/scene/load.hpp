// Loads the scene that a set describes.
#pragma once

#include <cstdint>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::scene {

// Loads every object of the set. Geometry that nodes share (the same accessors) becomes one mesh
// with several instances, also where objects name the same file. Throws previz::Error naming the
// file and what is wrong in it; what can be left out (zero-area and NaN triangles, extensions that
// are used but not required) goes into Scene::notes. The set's surfaces replace the colours of
// real objects' materials; a surface that no real object has is an error too. Where
// textures have more than `most_texels` together, they are made smaller, with a note.
Scene load_scene(const set::Set& set, std::uint64_t most_texels = max_texels);

}  // namespace previz::scene
