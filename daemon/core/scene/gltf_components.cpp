#include "daemon/core/scene/gltf_components.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <string_view>

#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// A set of component types, each with "normalized" or without.
using Types = std::uint32_t;
constexpr int first_type = TINYGLTF_COMPONENT_TYPE_BYTE, last_type = TINYGLTF_COMPONENT_TYPE_FLOAT;
constexpr Types plain(int type) {
  return 1u << (type - first_type);
}
constexpr Types normalized(int type) {
  return plain(type) << 16;
}

constexpr Types byte = plain(TINYGLTF_COMPONENT_TYPE_BYTE),
                byte_n = normalized(TINYGLTF_COMPONENT_TYPE_BYTE),
                ubyte = plain(TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE),
                ubyte_n = normalized(TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE),
                short_ = plain(TINYGLTF_COMPONENT_TYPE_SHORT),
                short_n = normalized(TINYGLTF_COMPONENT_TYPE_SHORT),
                ushort_ = plain(TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT),
                ushort_n = normalized(TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT),
                uint_ = plain(TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT),
                float_ = plain(TINYGLTF_COMPONENT_TYPE_FLOAT);
constexpr Types unsigned_n = ubyte_n | ushort_n, signed_n = byte_n | short_n;

struct Allowed {
  Components use;
  Types core;       // by glTF itself, or by the extension that has the use
  Types quantised;  // by KHR_mesh_quantization besides
  Types tolerated;  // by nobody, but there is one meaning
  std::string_view in_words;
};
constexpr Allowed table[] = {
    {Components::floats, float_, 0, 0, "floats"},
    {Components::positions, float_, byte | ubyte | short_ | ushort_ | signed_n | unsigned_n, 0,
     "floats, or with KHR_mesh_quantization integers of 1 or 2 bytes"},
    {Components::normals, float_, signed_n, byte | short_,
     "floats, or with KHR_mesh_quantization normalized signed integers of 1 or 2 bytes"},
    {Components::tangents, float_, signed_n, byte | short_,
     "floats, or with KHR_mesh_quantization normalized signed integers of 1 or 2 bytes"},
    {Components::texture_coordinates, float_ | unsigned_n,
     byte | ubyte | short_ | ushort_ | signed_n, 0,
     "floats, normalized unsigned integers of 1 or 2 bytes, or with KHR_mesh_quantization any "
     "integers of 1 or 2 bytes"},
    {Components::colors, float_ | unsigned_n, 0, ubyte | ushort_,
     "floats or normalized unsigned integers of 1 or 2 bytes"},
    {Components::joints, ubyte | ushort_, 0, unsigned_n | uint_,
     "unsigned integers of 1 or 2 bytes"},
    {Components::weights, float_ | unsigned_n, 0, ubyte | ushort_,
     "floats or normalized unsigned integers of 1 or 2 bytes"},
    {Components::animated, float_ | signed_n | unsigned_n, 0, 0,
     "floats or normalized integers of 1 or 2 bytes"},
    {Components::copies_rotated, float_ | signed_n, 0, 0,
     "floats or normalized signed integers of 1 or 2 bytes"}};

const Allowed& allowed_for(Components use) {
  return *std::ranges::find(table, use, &Allowed::use);
}

// Returns the set of the accessor's type alone; empty where it is not one of glTF's.
Types type_of(const tinygltf::Accessor& accessor) {
  if (accessor.componentType < first_type || accessor.componentType > last_type) return 0;
  // "normalized" means nothing on floats.
  const bool is_float = accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
  return accessor.normalized && !is_float ? normalized(accessor.componentType)
                                          : plain(accessor.componentType);
}

std::string type_in_words(const tinygltf::Accessor& accessor) {
  constexpr std::string_view words[] = {"bytes", "unsigned bytes", "shorts", "unsigned shorts",
                                        "ints",  "unsigned ints",  "floats"};
  const Types type = type_of(accessor);
  if (type == 0) return "component type " + std::to_string(accessor.componentType);
  return (type >= normalized(first_type) ? "normalized " : "") +
         std::string(words[accessor.componentType - first_type]);
}

// Returns what an attribute of a vertex or a morph target is used for; floats: unknown.
Components use_of(std::string_view attribute) {
  if (attribute == "POSITION") return Components::positions;
  if (attribute == "NORMAL") return Components::normals;
  if (attribute == "TANGENT") return Components::tangents;
  if (attribute.starts_with("TEXCOORD_")) return Components::texture_coordinates;
  if (attribute.starts_with("COLOR_")) return Components::colors;
  if (attribute.starts_with("JOINTS_")) return Components::joints;
  if (attribute.starts_with("WEIGHTS_")) return Components::weights;
  return Components::floats;
}

}  // namespace

void check_components(const tinygltf::Accessor& accessor, Components use,
                      const std::string& where) {
  const Allowed& allowed = allowed_for(use);
  if ((type_of(accessor) & (allowed.core | allowed.quantised | allowed.tolerated)) != 0) return;
  throw Error(where + ": its numbers are " + type_in_words(accessor) + "; they must be " +
              std::string(allowed.in_words) + "; export the file again");
}

bool are_normalized(const tinygltf::Accessor& accessor, Components use) {
  if (use == Components::joints) return false;
  return accessor.normalized || use == Components::colors || use == Components::weights;
}

void note_component_types(const tinygltf::Model& model, Notes& notes) {
  const bool is_quantised = std::ranges::find(model.extensionsUsed, "KHR_mesh_quantization") !=
                            model.extensionsUsed.end();
  const auto look_at = [&](const std::map<std::string, int>& attributes) {
    for (const auto& [name, index] : attributes) {
      if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size()) continue;
      const tinygltf::Accessor& accessor = model.accessors[static_cast<std::size_t>(index)];
      const Allowed& allowed = allowed_for(use_of(name));
      const Types type = type_of(accessor);
      const std::string what = name + " of " + type_in_words(accessor);
      if (allowed.use == Components::floats || (type & allowed.core) != 0) continue;
      if ((type & allowed.quantised) != 0 && !is_quantised)
        notes.add(what +
                  " needs KHR_mesh_quantization, which the file does not name in "
                  "extensionsUsed; read as that says");
      else if ((type & allowed.tolerated) != 0)
        notes.add(what + " is not glTF; read as if it were " + std::string(allowed.in_words));
    }
  };
  for (const tinygltf::Mesh& mesh : model.meshes)
    for (const tinygltf::Primitive& primitive : mesh.primitives) {
      look_at(primitive.attributes);
      for (const std::map<std::string, int>& target : primitive.targets) look_at(target);
    }
}

}  // namespace previz::scene
