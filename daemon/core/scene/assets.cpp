#include "daemon/core/scene/assets.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "daemon/core/scene/gltf_text.hpp"
#include "daemon/core/scene/gltf_uri.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

std::uint32_t chunk_length(const char* bytes) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

// Returns the JSON of a glTF 2.0 file: the whole of a .gltf, the first chunk of a .glb (12 bytes of
// header, then the chunk's length and type).
std::string gltf_json(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::array<char, 20> header{};
  stream.read(header.data(), header.size());
  const bool binary = stream.gcount() == 20 && std::string(header.data(), 4) == "glTF";
  if (!binary) {
    return session::read_file(file, {"a model", max_file_bytes});
  }
  const std::uint32_t length = chunk_length(&header[12]);
  if (length > std::filesystem::file_size(file))
    throw Error(file.string() + ": its glTF header is damaged");
  std::string json(length, '\0');
  stream.read(json.data(), length);
  return json;
}

void check_self_contained(const std::filesystem::path& file) {
  const nlohmann::json gltf = parsed_json(gltf_json(file), file.string()).root;
  for (const char* kind : {"buffers", "images"}) {
    if (!gltf.contains(kind) || !gltf[kind].is_array()) continue;
    for (const nlohmann::json& item : gltf[kind]) {
      const std::string uri = item.is_object() ? item.value("uri", "") : "";
      if (!uri.empty() && !is_data_uri(uri))
        throw Error(file.string() + ": needs " + set::one_line(uri) +
                    " beside it; a session holds single files: export the scene as one .glb");
    }
  }
}

}  // namespace

std::vector<std::pair<std::string, std::filesystem::path>> assets_of(const set::Set& set) {
  std::vector<std::pair<std::string, std::filesystem::path>> assets;
  for (const set::Object& object : set.objects) {
    check_self_contained(object.file);
    assets.emplace_back(object.file_as_written, object.file);
  }
  if (const auto& room = set.lighting.room; room && !room->size_m) {
    check_self_contained(room->file);
    assets.emplace_back(room->file_as_written, room->file);
  }
  if (set.lighting.environment)
    assets.emplace_back(set.lighting.environment_as_written, *set.lighting.environment);
  return assets;
}

}  // namespace previz::scene
