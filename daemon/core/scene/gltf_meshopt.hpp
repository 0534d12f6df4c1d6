// Decodes the buffer views that meshoptimizer has compressed.
#pragma once

#include <tiny_gltf.h>

#include <string>
#include <vector>

#include "daemon/core/scene/gltf_decoding.hpp"

namespace previz::scene {

inline constexpr const char* meshopt_extensions[] = {"EXT_meshopt_compression",
                                                     "KHR_meshopt_compression"};

// Decodes the views whose buffer is empty into buffers of their own.
void decode_meshopt(tinygltf::Model& model, const std::vector<bool>& is_empty,
                    const std::string& file, DecodingLimit& limit);

}  // namespace previz::scene
