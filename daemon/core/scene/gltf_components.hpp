// Which types the numbers of a glTF accessor may have, by what they are used for (glTF 2.0, 3.7.2.1
// and 3.11; KHR_mesh_quantization; EXT_mesh_gpu_instancing).
#pragma once

#include <tiny_gltf.h>

#include <string>

#include "daemon/core/scene/load_log.hpp"

namespace previz::scene {

enum class Components {
  floats,  // of what has no other type: times, translations, scales, matrices
  positions,
  normals,
  tangents,
  texture_coordinates,
  colors,
  joints,
  weights,         // of joints
  animated,        // rotations and weights of morph targets in an animation
  copies_rotated,  // of EXT_mesh_gpu_instancing
};

// Throws previz::Error beginning with `where` if the accessor's type is not allowed for its use.
// Types of KHR_mesh_quantization are allowed whether the file names it or not.
void check_components(const tinygltf::Accessor& accessor, Components use, const std::string& where);

// Whether integers become fractions of their type's largest: for some uses there is one sound
// answer, whatever the accessor says.
bool are_normalized(const tinygltf::Accessor& accessor, Components use);

// Notes the vertex attributes whose type breaks the rules, and how they are read all the same:
// those of KHR_mesh_quantization where the file does not name it, and those of which a wrong
// "normalized" leaves only one meaning.
void note_component_types(const tinygltf::Model& model, Notes& notes);

}  // namespace previz::scene
