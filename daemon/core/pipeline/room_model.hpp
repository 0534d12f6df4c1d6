// Opens the set's room for the lighting: a box, or the surfaces of a glTF file.
#pragma once

#include <memory>

#include "daemon/core/lighting/room.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

// Returns null if the set has no room. Throws previz::Error naming the set file for a room file
// that cannot be read or holds no surface, and for a box that does not contain the light camera or
// the place from which the light is seen.
std::shared_ptr<const lighting::Room> open_room(const set::Set& set,
                                                const glm::dvec3& light_camera_position);

}  // namespace previz::pipeline
