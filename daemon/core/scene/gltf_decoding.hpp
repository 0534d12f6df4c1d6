// What both decoders of compressed meshes need (gltf_draco.hpp, gltf_meshopt.hpp).
#pragma once

#include <tiny_gltf.h>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// Bounds what one file is decoded to. A part of a buffer is decoded once, so that all compressed
// parts together are no longer than the buffers.
class DecodingLimit {
 public:
  explicit DecodingLimit(std::uint64_t buffers) : compressed_left_(buffers) {}
  // Throws previz::Error beginning with `where` where there would be too much.
  void add(std::uint64_t compressed, std::uint64_t decoded, const std::string& where);

 private:
  std::uint64_t compressed_left_, decoded_left_ = max_file_bytes;
};

// Adds a buffer of these bytes and a view of all of it; returns the index of the view.
int add_view(tinygltf::Model& model, std::vector<unsigned char> bytes);

}  // namespace previz::scene
