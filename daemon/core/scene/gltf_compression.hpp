// Decompresses the meshes of a glTF file (EXT_meshopt_compression, KHR_meshopt_compression as far
// as it is the same, KHR_draco_mesh_compression), so that everything else sees plain accessors.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/scene/gltf_json.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// What tinygltf cannot read of a compressed file, and was taken out of its JSON.
struct TakenOut {
  struct Indices {
    std::size_t mesh, primitive;
    int accessor;
  };
  std::vector<bool> is_empty;    // buffers that have no data, only a length
  std::vector<Indices> indices;  // of primitives that Draco has compressed
};

// Makes a JSON that tinygltf can read; `is_binary` says that buffer 0 may be in the file itself.
TakenOut take_out_compression(GltfJson& json, bool is_binary);

// Decodes into new buffers; what has uncompressed data as well is left as it is. Throws
// previz::Error beginning with `file` and naming the buffer view or the primitive if something
// cannot be decoded, or is so much longer than its compressed form that no encoder can have made
// it: a small file cannot ask for much memory.
void decompress(tinygltf::Model& model, const TakenOut& taken_out, const std::string& file);

}  // namespace previz::scene
