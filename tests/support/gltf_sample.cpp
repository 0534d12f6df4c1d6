#include "tests/support/gltf_sample.hpp"

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

namespace previz::test {
namespace {

using Json = GltfWriter::Json;

// A pyramid with a skin and a morph target, and an animation "go" of both.
void add_figure(GltfWriter& gltf, Json attributes, int indices) {
  const std::vector<unsigned char> joints = {0, 1, 0, 0, 1, 0, 0, 0, 1, 1,
                                             0, 0, 0, 0, 0, 0, 1, 1, 1, 1};
  const std::vector<glm::vec4> weights(5, glm::vec4(0.75f, 0.25f, 0, 0));
  const std::vector<glm::mat4> inverse(2, glm::mat4(1));
  attributes["JOINTS_0"] = gltf.accessor(gltf.view(joints), 5121, "VEC4", 5);
  attributes["WEIGHTS_0"] = gltf.values(5126, "VEC4", weights);
  const std::vector<glm::vec3> offsets(5, glm::vec3(0, 0.5f, 0));
  const int mesh = gltf.mesh(
      {{"attributes", attributes},
       {"indices", indices},
       {"targets", {{{"POSITION", gltf.positions(offsets)}, {"NORMAL", gltf.normals(offsets)}}}}},
      "figure");
  const int tip = gltf.add("nodes", {{"translation", {0, 1, 0}}});
  gltf.root("foot", -1, {{"children", {tip}}});
  gltf.root("figure", mesh, {{"skin", 0}, {"weights", {0.5}}});
  const int bind = gltf.values(5126, "MAT4", inverse);
  gltf.json["skins"] = {{{"joints", {tip + 1, tip}}, {"inverseBindMatrices", bind}}};
  const int times = gltf.values<float>(5126, "SCALAR", {0, 1});
  const int places = gltf.positions({{0, 1, 0}, {1, 1, 0}});
  const int changes = gltf.values<float>(5126, "SCALAR", {0, 1});
  gltf.json["animations"] = {
      {{"name", "go"},
       {"channels",
        {{{"sampler", 0}, {"target", {{"node", tip}, {"path", "translation"}}}},
         {{"sampler", 1}, {"target", {{"node", tip + 2}, {"path", "weights"}}}}}},
       {"samplers",
        {{{"input", times}, {"output", places}}, {{"input", times}, {"output", changes}}}}}};
}

}  // namespace

GltfWriter gltf_sample() {
  GltfWriter gltf;
  std::vector<unsigned char> rgba;
  for (int i = 0; i < 4 * 4 * 4; ++i) rgba.push_back(static_cast<unsigned char>(37 * i));
  const int texture = gltf.texture(4, 4, rgba, {{"magFilter", 9728}, {"wrapS", 33071}});
  Json glass = R"({
    "name": "glass",
    "alphaMode": "BLEND",
    "pbrMetallicRoughness": {
      "baseColorFactor": [1, 1, 0.5, 0.5],
      "baseColorTexture": {
        "texCoord": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1}}},
      "metallicFactor": 0.5},
    "emissiveFactor": [1, 0, 0],
    "extensions": {
      "KHR_materials_transmission": {"transmissionFactor": 1},
      "KHR_materials_ior": {"ior": 1.5},
      "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2},
      "KHR_materials_emissive_strength": {"emissiveStrength": 3}}})"_json;
  glass["pbrMetallicRoughness"]["baseColorTexture"]["index"] = texture;
  gltf.add("materials", glass);
  gltf.add("materials", R"({
    "name": "cloth",
    "extensions": {
      "KHR_materials_sheen": {"sheenColorFactor": [0.5, 1, 0.25], "sheenRoughnessFactor": 0.5},
      "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1},
      "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2]},
      "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25}
    }})"_json);
  gltf.add("materials", R"({"name": "night", "emissiveFactor": [0, 0, 1]})"_json);
  const int positions =
      gltf.positions({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}});
  const int sparse_indices = gltf.view(GltfWriter::bytes_of(std::vector<std::uint16_t>{4}));
  const int sparse_values = gltf.view(GltfWriter::bytes_of(std::vector<glm::vec3>{{0, 0, 2}}));
  gltf.json["accessors"][positions]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", sparse_indices}, {"componentType", 5123}}},
      {"values", {{"bufferView", sparse_values}}}};
  const Json attributes = {
      {"POSITION", positions},
      {"NORMAL", gltf.normals({{0, 0, -1}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}})},
      {"TEXCOORD_0", gltf.uvs({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5f, 0.5f}})}};
  const int indices =
      gltf.values<std::uint16_t>(5123, "SCALAR", {0, 2, 1, 0, 3, 2, 0, 1, 4, 1, 2, 4});
  const Json looks = {
      {"KHR_materials_variants", {{"mappings", {{{"material", 2}, {"variants", {0, 1}}}}}}}};
  gltf.json["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "day"}},
                                                                   {{"name", "night"}}};
  const int pyramid = gltf.mesh(
      {{"attributes", attributes}, {"indices", indices}, {"material", 0}, {"extensions", looks}},
      "pyramid");
  const int strip =
      gltf.mesh({{"attributes", {{"POSITION", positions}}}, {"mode", 5}, {"material", 1}}, "strip");
  gltf.json["extensionsUsed"] = {"KHR_lights_punctual", "KHR_materials_variants",
                                 "KHR_texture_transform"};
  gltf.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"intensity", 5}, {"spot", {{"outerConeAngle", 0.5}}}}};
  const int child =
      gltf.add("nodes", {{"mesh", strip}, {"rotation", {0, 0.6, 0, 0.8}}, {"scale", {1, -2, 1}}});
  gltf.root("pyramid", pyramid, {{"children", {child}}, {"translation", {0, 1, 0}}});
  gltf.root("lamp", -1, {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  add_figure(gltf, attributes, indices);
  gltf.root("again", pyramid, {{"matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1}}});
  return gltf;
}

}  // namespace previz::test
