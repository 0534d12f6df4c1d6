#include "daemon/core/scene/gltf_json.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>

#include "daemon/core/scene/gltf_extensions.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

using Json = nlohmann::json;

constexpr std::uint64_t largest_int = std::numeric_limits<int>::max();  // of tinygltf's indices
constexpr std::uint64_t largest_size = 1ull
                                       << 53;  // up to here JSON's numbers are exact everywhere

// Where a whole number stands. In a path "*" is every element or member, and "**Texture" is every
// member at any depth, but not within extras, whose name ends so.
struct WholeNumber {
  std::string_view path;
  std::uint64_t largest = largest_int;
};
constexpr WholeNumber whole_numbers[] = {
    {"scene"},
    {"scenes/*/nodes/*"},
    {"nodes/*/camera"},
    {"nodes/*/children/*"},
    {"nodes/*/mesh"},
    {"nodes/*/skin"},
    {"nodes/*/extensions/EXT_mesh_gpu_instancing/attributes/*"},
    {"nodes/*/extensions/KHR_lights_punctual/light"},
    {"meshes/*/primitives/*/attributes/*"},
    {"meshes/*/primitives/*/indices"},
    {"meshes/*/primitives/*/material"},
    {"meshes/*/primitives/*/mode"},
    {"meshes/*/primitives/*/targets/*/*"},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/attributes/*"},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView"},
    {"meshes/*/primitives/*/extensions/KHR_materials_variants/mappings/*/material"},
    {"meshes/*/primitives/*/extensions/KHR_materials_variants/mappings/*/variants/*"},
    {"skins/*/inverseBindMatrices"},
    {"skins/*/joints/*"},
    {"skins/*/skeleton"},
    {"animations/*/channels/*/sampler"},
    {"animations/*/channels/*/target/node"},
    {"animations/*/samplers/*/input"},
    {"animations/*/samplers/*/output"},
    {"accessors/*/bufferView"},
    {"accessors/*/byteOffset", largest_size},
    {"accessors/*/componentType"},
    {"accessors/*/count", largest_size},
    {"accessors/*/sparse/count"},
    {"accessors/*/sparse/indices/bufferView"},
    {"accessors/*/sparse/indices/byteOffset"},
    {"accessors/*/sparse/indices/componentType"},
    {"accessors/*/sparse/values/bufferView"},
    {"accessors/*/sparse/values/byteOffset"},
    {"bufferViews/*/buffer"},
    {"bufferViews/*/byteLength", largest_size},
    {"bufferViews/*/byteOffset", largest_size},
    {"bufferViews/*/byteStride", largest_size},
    {"bufferViews/*/target"},
    {"bufferViews/*/extensions/EXT_meshopt_compression/buffer"},
    {"bufferViews/*/extensions/EXT_meshopt_compression/byteLength", largest_size},
    {"bufferViews/*/extensions/EXT_meshopt_compression/byteOffset", largest_size},
    {"bufferViews/*/extensions/EXT_meshopt_compression/byteStride", largest_size},
    {"bufferViews/*/extensions/EXT_meshopt_compression/count", largest_size},
    {"bufferViews/*/extensions/KHR_meshopt_compression/buffer"},
    {"bufferViews/*/extensions/KHR_meshopt_compression/byteLength", largest_size},
    {"bufferViews/*/extensions/KHR_meshopt_compression/byteOffset", largest_size},
    {"bufferViews/*/extensions/KHR_meshopt_compression/byteStride", largest_size},
    {"bufferViews/*/extensions/KHR_meshopt_compression/count", largest_size},
    {"buffers/*/byteLength", largest_size},
    {"images/*/bufferView"},
    {"textures/*/sampler"},
    {"textures/*/source"},
    {"textures/*/extensions/*/source"},
    {"samplers/*/magFilter"},
    {"samplers/*/minFilter"},
    {"samplers/*/wrapS"},
    {"samplers/*/wrapT"},
    {"materials/*/**Texture/extensions/KHR_texture_transform/texCoord"},
    {"materials/*/**Texture/index"},
    {"materials/*/**Texture/texCoord"}};

class WholeNumberCheck {
 public:
  WholeNumberCheck(GltfJson& json, const std::string& file) : json_(json), file_(file) {}

  void run() {
    for (const WholeNumber& rule : whole_numbers) {
      largest_ = rule.largest;
      walk(json_.root, rule.path, nullptr);
    }
  }

 private:
  void walk(Json& value, std::string_view path, const JsonPlace* place) {
    if (path.empty()) return check(value, place);
    const std::size_t slash = path.find('/');
    const std::string_view name = path.substr(0, slash);
    const std::string_view rest =
        slash == std::string_view::npos ? std::string_view() : path.substr(slash + 1);
    if (name.starts_with("**")) return search(value, name.substr(2), rest, place);
    if (value.is_array() && name == "*") {
      std::size_t index = 0;
      for (Json& element : value) {
        const JsonPlace at{place, "", index++};
        walk(element, rest, &at);
      }
    } else if (value.is_object() && name == "*") {
      for (auto member = value.begin(); member != value.end(); ++member)
        step(*member, member.key(), rest, place);
    } else if (value.is_object()) {
      if (const auto member = value.find(name); member != value.end())
        step(*member, member.key(), rest, place);
    }
  }

  void step(Json& member, const std::string& key, std::string_view rest, const JsonPlace* place) {
    const JsonPlace at{place, key};
    walk(member, rest, &at);
  }

  void search(Json& value, std::string_view ending, std::string_view rest, const JsonPlace* place) {
    if (!value.is_object()) return;
    for (auto member = value.begin(); member != value.end(); ++member) {
      if (member.key() == "extras") continue;
      const JsonPlace at{place, member.key()};
      if (member.key().ends_with(ending)) walk(*member, rest, &at);
      search(*member, ending, rest, &at);
    }
  }

  void check(Json& value, const JsonPlace* place) {
    if (value.is_number_unsigned() && value.get<std::uint64_t>() <= largest_) return;
    if (value.is_number()) {
      const auto number = value.get<double>();
      if (number >= 0 && number <= static_cast<double>(largest_) && std::floor(number) == number) {
        value = static_cast<std::uint64_t>(number);
        json_.is_changed = true;
        return;
      }
    }
    constexpr std::size_t most_shown = 40;
    std::string shown = value.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (shown.size() > most_shown) shown = shown.substr(0, most_shown) + "...";
    throw Error(file_ + ": " + in_words(place) + " is " + set::one_line(shown) +
                "; it must be a whole number from 0 to " + std::to_string(largest_) +
                "; export the file again, or correct it there");
  }

  GltfJson& json_;
  const std::string& file_;
  std::uint64_t largest_ = 0;
};

std::string text_of(const Json& object, const char* key) {
  const auto member = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && member != object.end() && member->is_string()
             ? member->get<std::string>()
             : std::string();
}

struct Version {
  int major = -1, minor = 0;
  auto operator<=>(const Version&) const = default;
};

Version version_of(const std::string& text) {
  Version version;
  const char* const end = text.data() + text.size();
  const auto major = std::from_chars(text.data(), end, version.major);
  if (major.ec == std::errc() && major.ptr != end && *major.ptr == '.')
    std::from_chars(major.ptr + 1, end, version.minor);
  return version;
}

// A file of glTF 1.0 may do without an asset; its meshes are an object, and it has shaders.
bool looks_like_version_1(const Json& root) {
  const auto meshes = root.find("meshes");
  return (meshes != root.end() && meshes->is_object()) || root.contains("techniques") ||
         root.contains("shaders");
}

void check_version(const Json& root, const std::string& file) {
  const Json asset = root.value("asset", Json::object());
  const std::string version = text_of(asset, "version");
  if (version.empty() && looks_like_version_1(root)) refuse_version("1.0", file);
  if (version.empty())
    throw Error(file +
                ": is not a valid glTF file: it has no asset.version, a text such as \"2.0\"");
  if (version_of(version).major != 2) refuse_version(version, file);
  const std::string least = text_of(asset, "minVersion");
  if (!least.empty() && version_of(least) > Version{2, 0})
    throw Error(file + ": asks for a reader of glTF " + set::one_line(least) +
                " (asset.minVersion); previzd reads glTF 2.0: export the file as glTF 2.0");
}

}  // namespace

void refuse_version(const std::string& version, const std::string& file) {
  const std::string what =
      file + ": is glTF " + set::one_line(version) + "; previzd reads glTF 2.0: ";
  if (version_of(version) > Version{1, 0}) throw Error(what + "export it again as glTF 2.0");
  throw Error(what +
              "convert it with \"gltf-pipeline -i OLD -o NEW\", or import it in a program that "
              "still reads glTF 1.0 and export it again");
}

GltfJson checked_json(std::string_view text, const std::string& file) {
  GltfJson json = parsed_json(text, file);
  check_version(json.root, file);
  check_required_extensions(json.root, file);
  WholeNumberCheck(json, file).run();
  return json;
}

}  // namespace previz::scene
