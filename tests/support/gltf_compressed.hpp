// glTF files whose meshes are compressed, for tests: a wavy grid with normals and texture
// coordinates, as it is and by the libraries that encode it.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "tests/support/gltf_writer.hpp"

namespace previz::test {

struct Grid {
  std::vector<glm::vec3> positions, normals;  // positions in -1..1
  std::vector<glm::vec2> uvs;                 // 0..1
  std::vector<std::uint32_t> indices;
};
Grid grid();

inline constexpr int draco_position_bits = 14, draco_normal_bits = 10, draco_uv_bits = 12;

GltfWriter plain_grid();
GltfWriter meshopt_grid();
GltfWriter draco_grid();

// Adds a view that decodes to `count` elements of `stride` bytes; returns its index.
int meshopt_view(GltfWriter& gltf, const std::vector<unsigned char>& encoded, const char* mode,
                 std::size_t count, std::size_t stride, const char* filter = "NONE");

// Encodes `count` elements as mode ATTRIBUTES does.
std::vector<unsigned char> meshopt_vertices(const void* data, std::size_t count,
                                            std::size_t stride);

}  // namespace previz::test
