#include "daemon/core/scene/gltf_extensions.hpp"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>

#include "daemon/core/scene/material_extensions.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// The last is of extensions that say what a material looks like in place of glTF's own words.
enum class Support { read, ignored, refused, replaces };

struct Extension {
  std::string_view name;
  Support support;
  std::string_view text;  // ignored: what is different; others: what can be done
};

constexpr std::string_view plain_textures = "export the file with textures in PNG, JPEG or WebP";
constexpr std::string_view own_materials = "export the file with glTF's own materials";
constexpr std::string_view plain_meshes =
    "export the object as a mesh of triangles with its materials";

// Those of materials are in material_extensions.hpp, but for the variants, which change no
// material.
constexpr Extension extensions[] = {
    {"EXT_mesh_gpu_instancing", Support::read, ""},
    {"EXT_meshopt_compression", Support::read, ""},
    {"EXT_texture_webp", Support::read, ""},
    {"KHR_draco_mesh_compression", Support::read, ""},
    {"KHR_lights_punctual", Support::read, ""},
    {"KHR_materials_variants", Support::read, ""},
    {"KHR_mesh_quantization", Support::read, ""},
    {"KHR_meshopt_compression", Support::read, ""},
    {"KHR_node_visibility", Support::read, ""},
    {"KHR_texture_transform", Support::read, ""},
    {"KHR_animation_pointer", Support::ignored,
     "what it animates besides nodes and weights stands still"},
    {"KHR_xmp", Support::ignored, "it says who made the file, and changes nothing to see"},
    {"KHR_xmp_json_ld", Support::ignored, "it says who made the file, and changes nothing to see"},
    {"CESIUM_RTC", Support::refused, "export the file with its place in the nodes' translations"},
    {"EXT_texture_avif", Support::refused, plain_textures},
    {"KHR_gaussian_splatting", Support::refused, plain_meshes},
    {"KHR_materials_cmnBlinnPhong", Support::replaces, own_materials},
    {"KHR_materials_common", Support::replaces, own_materials},
    {"KHR_techniques_webgl", Support::replaces, own_materials},
    {"KHR_texture_basisu", Support::refused, plain_textures},
    {"MSFT_texture_dds", Support::refused, plain_textures},
    {"NV_materials_mdl", Support::replaces, own_materials}};

std::optional<Extension> find(std::string_view name) {
  for (const MaterialExtension& of_material : material_extensions())
    if (name == of_material.name)
      return of_material.ignored ? Extension{name, Support::ignored, of_material.ignored}
                                 : Extension{name, Support::read, ""};
  const auto* const at = std::ranges::find(extensions, name, &Extension::name);
  if (at == std::end(extensions)) return {};
  return *at;
}

std::string materials_with(const std::string& extension, const tinygltf::Model& model) {
  std::vector<std::size_t> with;
  for (std::size_t i = 0; i < model.materials.size(); ++i)
    if (model.materials[i].extensions.contains(extension)) with.push_back(i);
  return in_brackets(model, with);
}

}  // namespace

std::string in_brackets(const tinygltf::Model& model, const std::vector<std::size_t>& materials) {
  constexpr std::size_t most_named = 3;
  if (materials.empty()) return "";
  std::string names;
  for (std::size_t i = 0; i < std::min(materials.size(), most_named); ++i) {
    const std::string& name = model.materials[materials[i]].name;
    names += i > 0 ? ", " : "";
    names +=
        name.empty() ? "number " + std::to_string(materials[i]) : '"' + set::one_line(name) + '"';
  }
  if (materials.size() > most_named)
    names += " and " + std::to_string(materials.size() - most_named) + " more";
  return " (materials: " + names + ")";
}

bool replaces_materials(const std::string& extension) {
  const std::optional<Extension> known = find(extension);
  return known && known->support == Support::replaces;
}

void check_required_extensions(const nlohmann::json& root, const std::string& file) {
  const auto required = root.find("extensionsRequired");
  if (required == root.end() || !required->is_array()) return;
  for (const nlohmann::json& element : *required) {
    if (!element.is_string()) continue;
    const std::string name = element.get<std::string>();
    const std::optional<Extension> known = find(name);
    if (known && known->support < Support::refused) continue;
    std::string message =
        file + ": requires the extension \"" + set::one_line(name) + "\", which is not supported";
    message.append("; ").append(known ? known->text : "export the file without it");
    throw Error(message);
  }
}

void note_extensions(const tinygltf::Model& model, Notes& notes) {
  const std::set<std::string> required(model.extensionsRequired.begin(),
                                       model.extensionsRequired.end());
  std::vector<std::string> used = model.extensionsUsed;
  for (const std::string& name : required)
    if (std::ranges::find(used, name) == used.end()) used.push_back(name);
  for (const tinygltf::Material& material : model.materials)  // some forget to say so
    for (const auto& [name, content] : material.extensions)
      if (!find(name) && std::ranges::find(used, name) == used.end()) used.push_back(name);
  for (const std::string& name : used) {
    const std::optional<Extension> known = find(name);
    if (known && known->support == Support::read) continue;
    std::string note = "the extension \"" + set::one_line(name) + '"';
    note += required.contains(name) ? ", which the file requires, is not supported; ignored"
                                    : " is not supported; ignored";
    if (known && known->support == Support::ignored) note.append(": ").append(known->text);
    notes.add(note + materials_with(name, model));
  }
}

}  // namespace previz::scene
