// Decodes the primitives that Draco has compressed (KHR_draco_mesh_compression).
#pragma once

#include <tiny_gltf.h>

#include <string>

#include "daemon/core/scene/gltf_decoding.hpp"

namespace previz::scene {

// Decodes the primitives of which an accessor has no data. Their indices become 4-byte integers;
// attributes have the component types of their accessors.
void decode_draco(tinygltf::Model& model, const std::string& file, DecodingLimit& limit);

}  // namespace previz::scene
