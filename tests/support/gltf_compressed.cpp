#include "tests/support/gltf_compressed.hpp"

#include <draco/compression/encode.h>
#include <meshoptimizer.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>

namespace previz::test {
namespace {

using Json = GltfWriter::Json;

constexpr std::uint32_t side = 9;  // vertices

std::vector<unsigned char> meshopt_triangles(const std::vector<std::uint32_t>& indices,
                                             std::size_t vertices) {
  std::vector<unsigned char> bytes(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  bytes.resize(
      meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices.data(), indices.size()));
  return bytes;
}

template <typename Value>
int add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type,
                  const std::vector<Value>& values) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, Value::length(), draco::DT_FLOAT32, false, sizeof(Value), 0);
  const int id = mesh.AddAttribute(
      attribute, true, static_cast<draco::AttributeValueIndex::ValueType>(values.size()));
  for (std::uint32_t i = 0; i < values.size(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[i]);
  return id;
}

}  // namespace

Grid grid() {
  Grid grid;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const glm::vec2 uv = glm::vec2(x, y) / static_cast<float>(side - 1);
      grid.uvs.push_back(uv);
      grid.positions.emplace_back(2.0f * uv - 1.0f, 0.25f * std::sin(5 * uv.x));
      grid.normals.push_back(glm::normalize(glm::vec3(-0.625f * std::cos(5 * uv.x), 0, 1)));
      if (x + 1 == side || y + 1 == side) continue;
      const std::uint32_t corner = y * side + x;
      for (const std::uint32_t index :
           {corner, corner + 1, corner + side + 1, corner, corner + side + 1, corner + side})
        grid.indices.push_back(index);
    }
  return grid;
}

int meshopt_view(GltfWriter& gltf, const std::vector<unsigned char>& encoded, const char* mode,
                 std::size_t count, std::size_t stride, const char* filter) {
  const int index = gltf.view(encoded);
  Json& view = gltf.json["bufferViews"][index];
  Json extension = view;
  extension["mode"] = mode;
  extension["count"] = count;
  extension["byteStride"] = stride;
  extension["filter"] = filter;
  view = {{"buffer", 1},
          {"byteLength", count * stride},
          {"extensions", {{"EXT_meshopt_compression", extension}}}};
  if (std::string(mode) == "ATTRIBUTES") view["byteStride"] = stride;
  gltf.json["buffers"][1] = {{"byteLength", 1 << 20},
                             {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}};
  for (const char* key : {"extensionsUsed", "extensionsRequired"})
    gltf.json[key] = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
  return index;
}

std::vector<unsigned char> meshopt_vertices(const void* data, std::size_t count,
                                            std::size_t stride) {
  std::vector<unsigned char> bytes(meshopt_encodeVertexBufferBound(count, stride));
  bytes.resize(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), data, count, stride));
  return bytes;
}

GltfWriter plain_grid() {
  GltfWriter gltf;
  const Grid grid = test::grid();
  const Json attributes = {{"POSITION", gltf.positions(grid.positions)},
                           {"NORMAL", gltf.normals(grid.normals)},
                           {"TEXCOORD_0", gltf.uvs(grid.uvs)}};
  gltf.root("grid",
            gltf.mesh({{"attributes", attributes}, {"indices", gltf.indices(grid.indices)}}));
  return gltf;
}

GltfWriter meshopt_grid() {
  GltfWriter gltf;
  const Grid grid = test::grid();
  const std::size_t count = grid.positions.size();
  const auto attribute = [&](const auto& values, const char* type) {
    const std::size_t stride = sizeof values[0];
    const int view = meshopt_view(gltf, meshopt_vertices(values.data(), count, stride),
                                  "ATTRIBUTES", count, stride);
    return gltf.accessor(view, 5126, type, count);
  };
  const Json attributes = {{"POSITION", attribute(grid.positions, "VEC3")},
                           {"NORMAL", attribute(grid.normals, "VEC3")},
                           {"TEXCOORD_0", attribute(grid.uvs, "VEC2")}};
  const std::size_t indices = grid.indices.size();
  const int view =
      meshopt_view(gltf, meshopt_triangles(grid.indices, count), "TRIANGLES", indices, 4);
  gltf.root("grid", gltf.mesh({{"attributes", attributes},
                               {"indices", gltf.accessor(view, 5125, "SCALAR", indices)}}));
  return gltf;
}

GltfWriter draco_grid() {
  const Grid grid = test::grid();
  const std::size_t count = grid.positions.size();
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(count));
  const int positions = add_attribute(mesh, draco::GeometryAttribute::POSITION, grid.positions);
  const int normals = add_attribute(mesh, draco::GeometryAttribute::NORMAL, grid.normals);
  const int uvs = add_attribute(mesh, draco::GeometryAttribute::TEX_COORD, grid.uvs);
  for (std::size_t i = 0; i < grid.indices.size(); i += 3)
    mesh.AddFace({draco::PointIndex(grid.indices[i]), draco::PointIndex(grid.indices[i + 1]),
                  draco::PointIndex(grid.indices[i + 2])});
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, draco_position_bits);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, draco_normal_bits);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, draco_uv_bits);
  draco::EncoderBuffer encoded;
  if (!encoder.EncodeMeshToBuffer(mesh, &encoded).ok())
    throw std::runtime_error("cannot encode with Draco");

  GltfWriter gltf;
  const int view = gltf.view({encoded.data(), encoded.data() + encoded.size()});
  const auto id = [&](int attribute) { return mesh.attribute(attribute)->unique_id(); };
  const Json compressed = {
      {"bufferView", view},
      {"attributes",
       {{"POSITION", id(positions)}, {"NORMAL", id(normals)}, {"TEXCOORD_0", id(uvs)}}}};
  const Json attributes = {{"POSITION", gltf.accessor(-1, 5126, "VEC3", count)},
                           {"NORMAL", gltf.accessor(-1, 5126, "VEC3", count)},
                           {"TEXCOORD_0", gltf.accessor(-1, 5126, "VEC2", count)}};
  const int indices = gltf.accessor(-1, 5123, "SCALAR", grid.indices.size());
  gltf.root("grid", gltf.mesh({{"attributes", attributes},
                               {"indices", indices},
                               {"extensions", {{"KHR_draco_mesh_compression", compressed}}}}));
  for (const char* key : {"extensionsUsed", "extensionsRequired"})
    gltf.json[key] = {"KHR_draco_mesh_compression"};
  return gltf;
}

}  // namespace previz::test
