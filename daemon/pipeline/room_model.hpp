// The set's room as the lighting wants it: a box, or the surfaces of a glTF file.
#pragma once

#include <memory>

#include "daemon/lighting/room.hpp"
#include "daemon/set/set.hpp"

namespace previz::pipeline {

// Null where the set has no room. Throws previz::Error naming the set file: a file that cannot be
// read or holds no surface, a box that does not hold the light camera or the place it is seen from.
std::shared_ptr<const lighting::Room> open_room(const set::Set& set,
                                                const glm::dvec3& light_camera_position);

}  // namespace previz::pipeline
