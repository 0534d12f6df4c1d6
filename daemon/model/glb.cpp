#include "daemon/model/glb.hpp"

#include <tiny_gltf.h>

#include <algorithm>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <sstream>

#include "drivers/error.hpp"

namespace previz::model {
namespace {

glm::vec3 y_up(const glm::dvec3& v) {
  return {v.x, v.z, -v.y};
}

// A triangle's corners are its own, so that its normal is that of its face.
struct Mesh {
  std::vector<glm::vec3> positions, normals;
};

Mesh mesh_of(const Solid& solid) {
  Mesh mesh;
  for (const Face& face : solid.faces) {
    const glm::vec3 normal = y_up(normal_of(face));
    for (std::size_t i = 1; i + 1 < face.outline.size(); ++i)
      for (const std::size_t k : {std::size_t{0}, i, i + 1}) {
        mesh.positions.push_back(y_up(face.outline[k]));
        mesh.normals.push_back(normal);
      }
  }
  return mesh;
}

// Appends vectors to the buffer and returns the accessor for them.
int add_vectors(const std::vector<glm::vec3>& vectors, bool with_bounds, tinygltf::Model& model) {
  std::vector<unsigned char>& bytes = model.buffers.front().data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = vectors.size() * sizeof(glm::vec3);
  view.target = TINYGLTF_TARGET_ARRAY_BUFFER;
  bytes.resize(bytes.size() + view.byteLength);
  std::memcpy(bytes.data() + view.byteOffset, vectors.data(), view.byteLength);
  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model.bufferViews.size());
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  accessor.type = TINYGLTF_TYPE_VEC3;
  accessor.count = vectors.size();
  if (with_bounds) {
    glm::vec3 low(std::numeric_limits<float>::infinity()), high(-low);
    for (const glm::vec3& v : vectors) low = glm::min(low, v), high = glm::max(high, v);
    accessor.minValues = {low.x, low.y, low.z};
    accessor.maxValues = {high.x, high.y, high.z};
  }
  model.bufferViews.push_back(view);
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

tinygltf::Material matt(const std::string& name, const glm::dvec3& albedo) {
  tinygltf::Material material;
  material.name = name;
  material.pbrMetallicRoughness.baseColorFactor = {albedo.r, albedo.g, albedo.b, 1};
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 1;
  material.extensions["KHR_materials_specular"] =
      tinygltf::Value(tinygltf::Value::Object{{"specularFactor", tinygltf::Value(0.0)}});
  return material;
}

}  // namespace

std::string glb_of(const std::vector<Solid>& solids, const Colours& colours) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "previzd model";
  model.extensionsUsed = {"KHR_materials_specular"};
  model.buffers.emplace_back();
  tinygltf::Scene scene;
  for (const Solid& solid : solids) {
    const Mesh mesh = mesh_of(solid);
    const auto colour = colours.find(solid.name);
    model.materials.push_back(
        matt(solid.name, colour == colours.end() ? glm::dvec3(0.5) : colour->second));
    tinygltf::Primitive primitive;
    primitive.attributes["POSITION"] = add_vectors(mesh.positions, true, model);
    primitive.attributes["NORMAL"] = add_vectors(mesh.normals, false, model);
    primitive.material = static_cast<int>(model.materials.size()) - 1;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    tinygltf::Mesh its_mesh;
    its_mesh.name = solid.name;
    its_mesh.primitives.push_back(primitive);
    tinygltf::Node node;
    node.name = solid.name;
    node.mesh = static_cast<int>(model.meshes.size());
    scene.nodes.push_back(static_cast<int>(model.nodes.size()));
    model.meshes.push_back(its_mesh);
    model.nodes.push_back(node);
  }
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  std::ostringstream bytes;
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, bytes, false, true))
    throw Error("the model cannot be written as glTF");
  return bytes.str();
}

}  // namespace previz::model
