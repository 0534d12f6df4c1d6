#include "daemon/tools/model/glb.hpp"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <sstream>

#include "drivers/error.hpp"

namespace previz::model {
namespace {

std::vector<glm::vec3> y_up(std::vector<glm::vec3> vectors) {
  for (glm::vec3& v : vectors) v = {v.x, v.z, -v.y};
  return vectors;
}

// A model that no reader accepts is a fault of what it was made of.
void insist_on_numbers(const NamedMesh& named) {
  for (const auto* vectors : {&named.mesh.positions, &named.mesh.normals})
    for (const glm::vec3& v : *vectors)
      if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
        throw Error(
            "\"" + named.name +
            "\" has no shape: a side of it has no area or lies infinitely far; check its points");
}

// Appends values to the buffer and returns the view of them.
template <class T>
int add_view(const std::vector<T>& values, int target, tinygltf::Model& model) {
  std::vector<unsigned char>& bytes = model.buffers.front().data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = values.size() * sizeof(T);
  view.target = target;
  bytes.resize(bytes.size() + view.byteLength);
  std::memcpy(bytes.data() + view.byteOffset, values.data(), view.byteLength);
  model.bufferViews.push_back(view);
  return static_cast<int>(model.bufferViews.size()) - 1;
}

// Returns the accessor.
int add_indices(const std::vector<unsigned>& indices, tinygltf::Model& model) {
  tinygltf::Accessor accessor;
  accessor.bufferView = add_view(indices, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER, model);
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  accessor.type = TINYGLTF_TYPE_SCALAR;
  accessor.count = indices.size();
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

// Returns the accessor.
int add_vectors(const std::vector<glm::vec3>& vectors, bool with_bounds, tinygltf::Model& model) {
  tinygltf::Accessor accessor;
  accessor.bufferView = add_view(vectors, TINYGLTF_TARGET_ARRAY_BUFFER, model);
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  accessor.type = TINYGLTF_TYPE_VEC3;
  accessor.count = vectors.size();
  if (with_bounds) {
    glm::vec3 low(std::numeric_limits<float>::infinity()), high(-low);
    for (const glm::vec3& v : vectors) low = glm::min(low, v), high = glm::max(high, v);
    accessor.minValues = {low.x, low.y, low.z};
    accessor.maxValues = {high.x, high.y, high.z};
  }
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

std::string glb_of(const std::vector<NamedMesh>& meshes, const Colours& colours) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "previz model";
  model.extensionsUsed = {"KHR_materials_specular"};
  model.buffers.emplace_back();
  tinygltf::Scene scene;
  for (const NamedMesh& named : meshes) {
    insist_on_numbers(named);
    const auto colour = colours.find(named.name);
    const bool has_albedos = !named.albedos.empty();
    const glm::dvec3 own = colour == colours.end() ? glm::dvec3(0.5) : colour->second;
    model.materials.push_back(matt(named.name, has_albedos ? glm::dvec3(1) : own));
    tinygltf::Primitive primitive;
    primitive.attributes["POSITION"] = add_vectors(y_up(named.mesh.positions), true, model);
    primitive.attributes["NORMAL"] = add_vectors(y_up(named.mesh.normals), false, model);
    if (has_albedos) primitive.attributes["COLOR_0"] = add_vectors(named.albedos, false, model);
    primitive.indices = add_indices(named.mesh.indices, model);
    primitive.material = static_cast<int>(model.materials.size()) - 1;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    tinygltf::Mesh mesh;
    mesh.name = named.name;
    mesh.primitives.push_back(primitive);
    tinygltf::Node node;
    node.name = named.name;
    node.mesh = static_cast<int>(model.meshes.size());
    scene.nodes.push_back(static_cast<int>(model.nodes.size()));
    model.meshes.push_back(mesh);
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
