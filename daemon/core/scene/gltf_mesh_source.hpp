// Says what of a glTF file a mesh is made of (glTF 2.0, 3.7.2).
#pragma once

#include <tiny_gltf.h>
#include <array>
#include <compare>
#include <utility>
#include <vector>

namespace previz::scene {

// The TEXCOORD_n that a material reads, and its transform (KHR_texture_transform): (u', v') = (a u
// + b v + c, d u + e v + f).
struct UvMapping {
  int set = 0;
  std::array<double, 6> affine{1, 0, 0, 0, 1, 0};
  auto operator<=>(const UvMapping&) const = default;
};

// Everything that a mesh is made of: primitives with equal sources are the same mesh.
struct MeshSource {
  int positions = -1, normals = -1, colors = -1, indices = -1;  // accessors; -1: none
  int tangents = -1;  // also -1 where the material asks for no direction on its surface
  int mode = TINYGLTF_MODE_TRIANGLES;
  std::vector<UvMapping> mappings;              // at least one
  std::vector<int> uvs;                         // accessors, one for each mapping; -1: none
  std::vector<std::pair<int, int>> influences;  // accessors: joints, weights
  std::vector<std::pair<int, int>> targets;     // accessors: positions, normals; -1: none
  std::size_t joints = 0;                       // of the skin
  auto operator<=>(const MeshSource&) const = default;
};

// Without mappings the source has TEXCOORD_0 as it is.
MeshSource mesh_source(const tinygltf::Primitive& primitive, std::vector<UvMapping> mappings);

}  // namespace previz::scene
