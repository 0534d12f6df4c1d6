// Puts a glTF file where the set has it, for programs that do not know the set.
#pragma once

#include <glm/mat4x4.hpp>
#include <string>

namespace previz::exchange {

// Returns the content of a .gltf or .glb file with a node named `name` above all others of its
// scene, which moves them by `world_from_file` (the set's axes, Z up; the file stays Y up, as glTF
// is). Nothing else is changed. Throws previz::Error, which does not name the file, if the content
// is not glTF 2.
std::string placed_model(const std::string& content, const std::string& name,
                         const glm::dmat4& world_from_file);

}  // namespace previz::exchange
