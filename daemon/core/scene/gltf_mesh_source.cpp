#include "daemon/core/scene/gltf_mesh_source.hpp"

namespace previz::scene {

MeshSource mesh_source(const tinygltf::Primitive& primitive, std::vector<UvMapping> mappings) {
  MeshSource source;
  if (mappings.empty()) mappings.emplace_back();
  source.positions = attribute(primitive, "POSITION");
  source.normals = attribute(primitive, "NORMAL");
  source.colors = attribute(primitive, "COLOR_0");
  for (const UvMapping& mapping : mappings)
    source.uvs.push_back(attribute(primitive, "TEXCOORD_" + std::to_string(mapping.set)));
  source.indices = primitive.indices;
  if (primitive.mode >= 0) source.mode = primitive.mode;
  source.mappings = std::move(mappings);
  return source;
}

bool has_usable_positions(const Mesh& mesh) {
  return std::ranges::all_of(mesh.positions, is_usable);
}

}  // namespace previz::scene
