#include "daemon/tools/exchange/placed_model.hpp"

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

#include "daemon/core/scene/gltf.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

using GltfJson = nlohmann::ordered_json;

// glTF 2.0, section 4: a header of three words, then chunks of a length, a type and that many
// bytes. The first one is the JSON.
constexpr std::size_t word = 4, header = 3 * word, chunk_header = 2 * word;

std::uint32_t word_at(const std::string& content, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, content.data() + at, word);  // little-endian, as every machine of the rig
  return value;
}

std::string word_text(std::size_t value) {
  const auto number = static_cast<std::uint32_t>(value);
  std::string text(word, '\0');
  std::memcpy(text.data(), &number, word);
  return text;
}

std::string place_json(const std::string& text, const std::string& name,
                       const glm::dmat4& world_from_file) {
  GltfJson json = GltfJson::parse(text, nullptr, /*allow_exceptions=*/false);
  const auto scene = json.is_object() ? json.value("scene", std::size_t{0}) : 0;
  if (!json.is_object() || !json.contains("scenes") || !json["scenes"].is_array() ||
      scene >= json["scenes"].size() || !json["scenes"][scene].contains("nodes"))
    throw Error("has no glTF 2 scene to place");
  const glm::dmat4 placed =
      glm::transpose(scene::z_up_from_y_up) * world_from_file * scene::z_up_from_y_up;
  GltfJson matrix = GltfJson::array();
  for (int c = 0; c < 4; ++c)
    for (int r = 0; r < 4; ++r) matrix.push_back(placed[c][r]);
  GltfJson& roots = json["scenes"][scene]["nodes"];
  json["nodes"].push_back({{"name", name}, {"matrix", matrix}, {"children", roots}});
  roots = GltfJson::array({json["nodes"].size() - 1});
  return json.dump();
}

}  // namespace

std::string placed_model(const std::string& content, const std::string& name,
                         const glm::dmat4& world_from_file) {
  try {
    if (!content.starts_with("glTF")) return place_json(content, name, world_from_file);
    if (content.size() < header + chunk_header ||
        content.size() - header - chunk_header < word_at(content, header))
      throw Error("is truncated");
    const std::size_t length = word_at(content, header), begin = header + chunk_header;
    std::string json = place_json(content.substr(begin, length), name, world_from_file);
    while (json.size() % word) json += ' ';
    const std::string rest = content.substr(begin + length);
    return content.substr(0, 2 * word) + word_text(begin + json.size() + rest.size()) +
           word_text(json.size()) + content.substr(header + word, word) + json + rest;
  } catch (const nlohmann::json::exception& error) {
    throw Error(std::string("is not glTF 2: ") + error.what());
  }
}

}  // namespace previz::exchange
