#include "daemon/core/scene/gltf_material.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <variant>

#include "daemon/core/scene/gltf_extensions.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

constexpr double max_radiance = 1e30;
constexpr const char* specular_glossiness = "KHR_materials_pbrSpecularGlossiness";
constexpr const char* gloss_texture = "specularGlossinessTexture";

// A reference to a texture, from the core of glTF or from an extension.
struct TextureInfo {
  int index = -1;
  double set = 0;
  tinygltf::Value transform;  // KHR_texture_transform
};

template <typename CoreInfo>
TextureInfo info_of(const CoreInfo& core) {
  return {core.index, static_cast<double>(core.texCoord),
          extension(core.extensions, "KHR_texture_transform")};
}

TextureInfo info_of(const tinygltf::Value& extension, const std::string& key) {
  const tinygltf::Value given = extension.Has(key) ? extension.Get(key) : tinygltf::Value();
  if (!given.IsObject()) return {};
  const tinygltf::Value own = given.Has("extensions") ? given.Get("extensions") : tinygltf::Value();
  const bool has_transform = own.IsObject() && own.Has("KHR_texture_transform");
  return {static_cast<int>(std::clamp(number(given, "index", -1), -1.0, 2e9)),
          number(given, "texCoord", 0),
          has_transform ? own.Get("KHR_texture_transform")
                        : tinygltf::Value(tinygltf::Value::Object{})};
}

UvMapping read_mapping(const TextureInfo& texture, const std::string& what, Notes& notes) {
  constexpr double last_set = 255;  // far beyond what files have
  UvMapping mapping;
  const double set = number(texture.transform, "texCoord", texture.set);
  if (set >= 0 && set <= last_set && set == std::floor(set))
    mapping.set = static_cast<int>(set);
  else
    notes.add(what + ": its set of texture coordinates is not from 0 to 255; set 0 used");
  const std::vector<double> offset = numbers(texture.transform, "offset", {0, 0});
  const std::vector<double> scale = numbers(texture.transform, "scale", {1, 1});
  const double rotation = number(texture.transform, "rotation", 0);
  const double c = std::cos(rotation), s = std::sin(rotation);
  // The rotation is counter-clockwise as seen with v downwards, as in the extension's example and
  // in other viewers.
  mapping.affine = {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
  for (const double value : mapping.affine)
    if (!std::isfinite(value)) throw Error(what + ": its texture transform is not finite");
  return mapping;
}

// Reads one factor into a material that has its default. Returns whether it is raised to what is
// supported.
bool read_factor(const Factor& factor, const tinygltf::Value& from, const std::string& what,
                 Material& material, Notes& notes) {
  const std::string named = what + ": " + factor.key;
  if (const auto* const color = std::get_if<Packed<glm::vec3>>(&factor.value)) {
    glm::vec3& value = material.*color->member;
    const std::vector<double> rgb = numbers(from, factor.key, {value.r, value.g, value.b});
    value = color_within(rgb, factor.most, named, notes);
    return false;
  }
  float& value = material.*std::get<Packed<float>>(factor.value).member;
  value = within(number(from, factor.key, value), factor.least, factor.most, named, notes);
  const bool is_raised = value < factor.supported;
  value = std::max(value, factor.supported);
  return is_raised;
}

// Makes a material one that does not have the extension. Of a layer that is not there by its
// factors, the textures that were read say nothing.
void forget(const MaterialExtension& row, Material& material) {
  static const Material standard;
  const auto reset = [&](auto packed) { material.*packed.member = standard.*packed.member; };
  for (const Factor& factor : row.factors) std::visit(reset, factor.value);
  if (row.is_there) return;
  for (const LayerTexture& texture : row.textures) material.*texture.texture = no_texture;
}

float strongest(const glm::vec3& color) {
  return std::max({color.r, color.g, color.b});
}

// The header says why. Paint of the default index of refraction reflects 0.04, which the specular
// colour multiplies.
void read_gloss(const tinygltf::Value& gloss, const std::string& what, Material& material,
                Notes& notes) {
  constexpr float reflectance = 0.04f;
  const glm::vec3 specular = color_within(numbers(gloss, "specularFactor", {1, 1, 1}), 1,
                                          what + ": specularFactor", notes);
  const float most = strongest(specular);
  material.metallic = 0;
  material.roughness =
      1 - within(number(gloss, "glossinessFactor", 1), 0, 1, what + ": glossinessFactor", notes);
  material.specular = std::min(most / reflectance, 1.0f);
  if (most > 0) material.specular_color = specular / (reflectance * material.specular);
}

AlphaMode alpha_mode(const std::string& mode, const std::string& what, Notes& notes) {
  if (mode == "MASK") return AlphaMode::mask;
  if (mode == "BLEND") return AlphaMode::blend;
  if (mode != "OPAQUE")
    notes.add(what + ": alphaMode \"" + set::one_line(mode) + "\" is unknown; OPAQUE used");
  return AlphaMode::opaque;
}

// Throws previz::Error beginning with `where` for a material whose look is in what is not read: it
// would be white.
void refuse_foreign(const tinygltf::Material& given, const std::string& where) {
  const auto has = [&](const char* key) { return given.values.contains(key); };
  if (has("baseColorTexture") && given.pbrMetallicRoughness.baseColorTexture.index < 0)
    throw Error(where +
                ": its base colour texture names no texture, and without it the surface "
                "would be white; export the file again");
  if (!given.values.empty() || given.emissiveTexture.index >= 0 ||
      given.emissiveFactor != std::vector<double>{0, 0, 0})
    return;
  std::string foreign;
  for (const auto& extension_of_material : given.extensions) {
    const std::string& name = extension_of_material.first;
    const auto row =
        std::ranges::find_if(material_extensions(), [&](const auto& r) { return name == r.name; });
    if (row != material_extensions().end() && !row->ignored) return;
    if (replaces_materials(name)) foreign = name;
  }
  if (!foreign.empty())
    throw Error(where + ": its look is in the extension \"" + foreign +
                "\", which is not supported, and without it the surface would be white; export the "
                "file with glTF's own materials");
}

}  // namespace

LookTexture look_texture(const tinygltf::Material& material, const std::string& what,
                         Notes& notes) {
  const TextureInfo infos[] = {
      info_of(material.pbrMetallicRoughness.baseColorTexture),
      info_of(extension(material.extensions, specular_glossiness), "diffuseTexture"),
      info_of(material.emissiveTexture)};
  for (const TextureInfo& info : infos)
    if (info.index >= 0) return {info.index, read_mapping(info, what, notes)};
  return {};
}

UsedMaterial GltfMaterials::use(int index) {
  const auto [at, is_new] = used_.try_emplace(index);
  if (!is_new) return at->second;
  if (index < 0) {
    tinygltf::Material standard;
    standard.name = "default";
    at->second = read(standard, "the default material");
    return at->second;
  }
  if (static_cast<std::size_t>(index) >= model_.materials.size())
    throw Error(file_ + ": a primitive uses material " + std::to_string(index) +
                ", which does not exist");
  const auto number = static_cast<std::size_t>(index);
  const tinygltf::Material& given = model_.materials[number];
  refuse_foreign(given, file_ + ": " + numbered("material", number, given.name));
  at->second = read(given, numbered("material", number, given.name));
  return at->second;
}

std::map<std::uint32_t, std::size_t> GltfMaterials::one_sided() const {
  std::map<std::uint32_t, std::size_t> result;
  for (const auto& [number, material] : used_) {
    if (number < 0 || transmits(scene_.materials[material.index])) continue;
    const auto index = static_cast<std::size_t>(number);
    if (!model_.materials[index].doubleSided) result.emplace(material.index, index);
  }
  return result;
}

// The textures of one material, and the mappings that they are read by.
class GltfMaterials::Textures {
 public:
  Textures(GltfTextures& textures, const std::string& what, Notes& notes, Material& material)
      : textures_(textures), what_(what), notes_(notes), material_(material) {}

  // Gives the material a texture. Returns false if the file names one that cannot be had.
  bool take(const TextureInfo& info, Encoding encoding, std::uint32_t Material::*texture,
            const std::string& which, std::optional<float> glossiness = {}) {
    if (info.index < 0) return true;
    const UvMapping wanted = read_mapping(info, what_ + ", " + which, notes_);
    const bool white = texture == &Material::base_color_texture ||
                       texture == &Material::emission_texture ||
                       (which == gloss_texture && strongest(material_.specular_color) > 1);
    const bool cuts_out =
        texture == &Material::base_color_texture && material_.alpha_mode != AlphaMode::opaque;
    material_.*texture = textures_.use(info.index, encoding, white, glossiness, cuts_out);
    if (material_.*texture == no_texture) return false;
    const auto at = std::ranges::find(mappings, wanted) - mappings.begin();
    if (at == std::ssize(mappings)) mappings.push_back(wanted);
    const auto role = std::ranges::find(material_textures, texture) - material_textures.begin();
    material_.mappings[static_cast<std::size_t>(role)] = static_cast<std::uint8_t>(at);
    return true;
  }

  // KHR_materials_pbrSpecularGlossiness: one texture of the specular colour and, in its alpha, the
  // glossiness.
  void take_gloss(const tinygltf::Value& gloss) {
    const std::string key = gloss_texture;
    const TextureInfo info = info_of(gloss, key);
    const float glossiness = 1 - material_.roughness;
    take(info, Encoding::srgb, &Material::specular_color_texture, key);
    take(info, Encoding::linear, &Material::metallic_roughness_texture, key, glossiness);
    if (material_.metallic_roughness_texture != no_texture) material_.roughness = 1;
  }

  // Takes the textures of an extension. Returns false if one without which it says nothing about
  // any place of the surface cannot be had.
  bool take(const tinygltf::Value& extension, const MaterialExtension& row) {
    for (const LayerTexture& texture : row.textures) {
      const std::string key = texture.key;
      const bool is_taken = take(info_of(extension, key), texture.encoding, texture.texture, key);
      if (!texture.scale) {
        if (!is_taken) return false;
      } else if (extension.Has(key) && extension.Get(key).IsObject()) {
        material_.*texture.scale = within(number(extension.Get(key), "scale", 1), -1e3, 1e3,
                                          what_ + ": " + key + "'s scale", notes_);
      }
    }
    return true;
  }

  std::vector<UvMapping> mappings;

 private:
  GltfTextures& textures_;
  const std::string& what_;
  Notes& notes_;
  Material& material_;
};

UsedMaterial GltfMaterials::read(const tinygltf::Material& given, const std::string& what) {
  const tinygltf::PbrMetallicRoughness& pbr = given.pbrMetallicRoughness;
  const bool is_glossy = given.extensions.contains(specular_glossiness);
  const tinygltf::Value gloss = extension(given.extensions, specular_glossiness);
  const std::vector<double> color =
      is_glossy ? numbers(gloss, "diffuseFactor", {1, 1, 1, 1}) : pbr.baseColorFactor;
  Material material;
  material.name = given.name;
  material.base_color = color_within(color, 1, what + ": its base colour", notes_);
  if (is_glossy) {
    read_gloss(gloss, what, material, notes_);
  } else {
    material.metallic = within(pbr.metallicFactor, 0, 1, what + ": metallicFactor", notes_);
    material.roughness = within(pbr.roughnessFactor, 0, 1, what + ": roughnessFactor", notes_);
  }
  material.alpha_mode = alpha_mode(given.alphaMode, what, notes_);
  if (material.alpha_mode != AlphaMode::opaque)
    material.alpha = within(color[3], 0, 1, what + ": its alpha", notes_);
  material.alpha_cutoff = within(given.alphaCutoff, 0, std::numeric_limits<float>::max(),
                                 what + ": alphaCutoff", notes_);
  const std::vector<double> emissive =
      given.emissiveFactor.size() == 3 ? given.emissiveFactor : std::vector<double>{0, 0, 0};
  const double strength =
      number(extension(given.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
  for (int i = 0; i < 3; ++i)
    material.emission[i] = within(emissive[static_cast<std::size_t>(i)] * strength, 0, max_radiance,
                                  what + ": its emission", notes_);

  // The base colour comes first, so that its mapping is the mesh's first (Material::mappings).
  Textures textures(textures_, what, notes_, material);
  textures.take(is_glossy ? info_of(gloss, "diffuseTexture") : info_of(pbr.baseColorTexture),
                Encoding::srgb, &Material::base_color_texture, "base colour texture");
  if (is_glossy)
    textures.take_gloss(gloss);
  else
    textures.take(info_of(pbr.metallicRoughnessTexture), Encoding::linear,
                  &Material::metallic_roughness_texture, "metallic-roughness texture");
  textures.take(info_of(given.emissiveTexture), Encoding::srgb, &Material::emission_texture,
                "emission texture");
  textures.take(info_of(given.normalTexture), Encoding::linear, &Material::normal_texture,
                "normal texture");
  material.normal_scale =
      within(given.normalTexture.scale, -1e3, 1e3, what + ": its normal texture's scale", notes_);
  // Occlusion textures are not left out: path tracing finds occlusion itself.
  for (const MaterialExtension& extension : material_extensions())
    read_extension(extension, given, what, textures, material);

  const auto index = static_cast<std::uint32_t>(scene_.materials.size());
  scene_.materials.push_back(std::move(material));
  return {index, std::move(textures.mappings)};
}

void GltfMaterials::read_extension(const MaterialExtension& row, const tinygltf::Material& given,
                                   const std::string& what, Textures& textures,
                                   Material& material) {
  const tinygltf::Value from = extension(given.extensions, row.name);
  std::vector<std::string> raised;
  for (const Factor& factor : row.factors)
    if (read_factor(factor, from, what, material, notes_))
      raised.push_back(what + ": its " + factor.key + " is raised to " +
                       std::to_string(factor.supported).substr(0, 4) + ", the supported minimum");
  if (!row.is_there || row.is_there(material)) {
    for (const std::string& note : raised) notes_.add(note);
    if (!textures.take(from, row)) {
      notes_.add(what + ": " + row.name + " is ignored, because its texture cannot be read");
      forget(row, material);
    }
  }
  if (!row.finish) return;
  const auto given_number = [&](const char* key, double otherwise) {
    return number(from, key, otherwise);
  };
  if (const char* const note = row.finish(given_number, material)) notes_.add(what + ": " + note);
}

}  // namespace previz::scene
