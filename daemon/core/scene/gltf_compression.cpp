#include "daemon/core/scene/gltf_compression.hpp"

#include <algorithm>
#include <cstdint>

#include "daemon/core/scene/gltf_draco.hpp"
#include "daemon/core/scene/gltf_meshopt.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

using Json = nlohmann::json;

bool has_array(const Json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_array();
}

bool has_extension(const Json& object, const char* name) {
  return object.is_object() && object.contains("extensions") && object["extensions"].is_object() &&
         object["extensions"].contains(name);
}

bool is_meshopt(const Json& object) {
  return std::ranges::any_of(meshopt_extensions,
                             [&](const char* name) { return has_extension(object, name); });
}

// tinygltf wraps whole numbers of extensions round at 32 bits, and reads others exactly.
void keep_large_numbers(GltfJson& json) {
  for (Json& view : json.root["bufferViews"])
    for (const char* name : meshopt_extensions) {
      if (!has_extension(view, name) || !view["extensions"][name].is_object()) continue;
      for (Json& value : view["extensions"][name])
        if (value.is_number_unsigned() && value.get<std::uint64_t>() > 0x7fffffff) {
          value = value.get<double>();
          json.is_changed = true;
        }
    }
}

// A buffer without data stands in for what its views decode to. It gets one byte.
void fill_empty_buffers(GltfJson& json, bool is_binary, TakenOut& taken_out) {
  Json& buffers = json.root["buffers"];
  std::vector<bool>& is_empty = taken_out.is_empty;
  for (const Json& buffer : buffers) is_empty.push_back(is_meshopt(buffer));
  for (const Json& view : json.root["bufferViews"]) {
    if (!is_meshopt(view) || !view.contains("buffer") || !view["buffer"].is_number_unsigned())
      continue;
    const auto index = view["buffer"].get<std::size_t>();
    if (index < buffers.size()) is_empty[index] = true;
  }
  for (std::size_t index = 0; index < buffers.size(); ++index) {
    Json& buffer = buffers[index];
    is_empty[index] = is_empty[index] && buffer.is_object() && !buffer.contains("uri") &&
                      !(is_binary && index == 0);
    if (!is_empty[index]) continue;
    buffer["uri"] = "data:application/octet-stream;base64,AA==";
    buffer["byteLength"] = 1;
    json.is_changed = true;
  }
}

// tinygltf refuses indices without data.
void take_out_indices(GltfJson& json, TakenOut& taken_out) {
  Json& meshes = json.root["meshes"];
  for (std::size_t mesh = 0; mesh < meshes.size(); ++mesh) {
    if (!has_array(meshes[mesh], "primitives")) continue;
    Json& primitives = meshes[mesh]["primitives"];
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      if (!has_extension(primitives[i], "KHR_draco_mesh_compression") ||
          !primitives[i].contains("indices"))
        continue;
      taken_out.indices.push_back({mesh, i, primitives[i]["indices"].get<int>()});
      primitives[i].erase("indices");
      json.is_changed = true;
    }
  }
}

}  // namespace

TakenOut take_out_compression(GltfJson& json, bool is_binary) {
  TakenOut taken_out;
  if (has_array(json.root, "buffers") && has_array(json.root, "bufferViews")) {
    fill_empty_buffers(json, is_binary, taken_out);
    keep_large_numbers(json);
  }
  if (has_array(json.root, "meshes")) take_out_indices(json, taken_out);
  return taken_out;
}

void decompress(tinygltf::Model& model, const TakenOut& taken_out, const std::string& file) {
  std::uint64_t size = 0;
  for (const tinygltf::Buffer& buffer : model.buffers) size += buffer.data.size();
  DecodingLimit limit(size);
  decode_meshopt(model, taken_out.is_empty, file, limit);
  for (const TakenOut::Indices& indices : taken_out.indices)
    if (indices.mesh < model.meshes.size() &&
        indices.primitive < model.meshes[indices.mesh].primitives.size())
      model.meshes[indices.mesh].primitives[indices.primitive].indices = indices.accessor;
  decode_draco(model, file, limit);
}

}  // namespace previz::scene
