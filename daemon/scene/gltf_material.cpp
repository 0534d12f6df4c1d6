#include "daemon/scene/gltf_material.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "daemon/scene/gltf_value.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::scene {
namespace {

constexpr double max_radiance = 1e30;
constexpr double max_distance_m = 1e15;  // attenuation is negligible beyond this
// Alpha is the same in either encoding; colours come in this one, often in the same image.
constexpr Encoding alpha_only = Encoding::srgb;

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

AlphaMode alpha_mode(const std::string& mode, const std::string& what, Notes& notes) {
  if (mode == "MASK") return AlphaMode::mask;
  if (mode == "BLEND") return AlphaMode::blend;
  if (mode != "OPAQUE")
    notes.add(what + ": alphaMode \"" + set::printable(mode) + "\" is unknown; OPAQUE used");
  return AlphaMode::opaque;
}

}  // namespace

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
  const tinygltf::Material& given = model_.materials[static_cast<std::size_t>(index)];
  at->second =
      read(given, "material " + std::to_string(index) + " \"" + set::printable(given.name) + "\"");
  return at->second;
}

// The textures of one material, and the mappings that they are read by.
class GltfMaterials::Textures {
 public:
  Textures(GltfTextures& textures, const std::string& what, Notes& notes, Material& material)
      : textures_(textures), what_(what), notes_(notes), material_(material) {}

  // Gives the material a texture. Returns false if the file names one that cannot be had.
  bool take(const TextureInfo& info, Encoding encoding, std::uint32_t Material::*texture,
            const std::string& which) {
    if (info.index < 0) return true;
    const UvMapping wanted = read_mapping(info, what_ + ", " + which, notes_);
    material_.*texture = textures_.use(info.index, encoding);
    if (material_.*texture == no_texture) return false;
    const auto at = std::ranges::find(mappings, wanted) - mappings.begin();
    if (at == std::ssize(mappings)) mappings.push_back(wanted);
    const auto role = std::ranges::find(material_textures, texture) - material_textures.begin();
    material_.mappings[static_cast<std::size_t>(role)] = static_cast<std::uint8_t>(at);
    return true;
  }

  // Takes a texture of an extension.
  bool take(const tinygltf::Value& extension, const std::string& key, Encoding encoding,
            std::uint32_t Material::*texture) {
    return take(info_of(extension, key), encoding, texture, key);
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
  Material material;
  material.name = given.name;
  material.base_color = color_within(pbr.baseColorFactor, 1, what + ": its base colour", notes_);
  material.metallic = within(pbr.metallicFactor, 0, 1, what + ": metallicFactor", notes_);
  material.roughness = within(pbr.roughnessFactor, 0, 1, what + ": roughnessFactor", notes_);
  material.alpha_mode = alpha_mode(given.alphaMode, what, notes_);
  if (material.alpha_mode != AlphaMode::opaque)
    material.alpha = within(pbr.baseColorFactor[3], 0, 1, what + ": its alpha", notes_);
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
  textures.take(info_of(pbr.baseColorTexture), Encoding::srgb, &Material::base_color_texture,
                "base colour texture");
  textures.take(info_of(pbr.metallicRoughnessTexture), Encoding::linear,
                &Material::metallic_roughness_texture, "metallic-roughness texture");
  textures.take(info_of(given.emissiveTexture), Encoding::srgb, &Material::emission_texture,
                "emission texture");
  textures.take(info_of(given.normalTexture), Encoding::linear, &Material::normal_texture,
                "normal texture");
  material.normal_scale =
      within(given.normalTexture.scale, -1e3, 1e3, what + ": its normal texture's scale", notes_);
  // Occlusion textures are not left out: path tracing finds occlusion itself.
  read_extensions(given, what, textures, material);

  const auto index = static_cast<std::uint32_t>(scene_.materials.size());
  scene_.materials.push_back(std::move(material));
  return {index, std::move(textures.mappings)};
}

void GltfMaterials::read_extensions(const tinygltf::Material& given, const std::string& what,
                                    Textures& textures, Material& material) {
  const tinygltf::Value ior = extension(given.extensions, "KHR_materials_ior");
  // An ior of 0 stands for a Fresnel term of 1 and is there for old specular-glossiness assets.
  material.ior = within(number(ior, "ior", 1.5), 1, 100, what + ": ior", notes_);
  read_glass(given, what, textures, material);
  read_clearcoat(given, what, textures, material);
  read_sheen(given, what, textures, material);
  read_specular(given, what, textures, material);
  read_anisotropy(given, what, textures, material);
}

// A factor whose texture cannot be had says nothing about any place of the surface.
void GltfMaterials::leave_out(const std::string& what, const std::string& extension) {
  notes_.add(what + ": " + extension + " is ignored, because its texture cannot be read");
}

void GltfMaterials::read_glass(const tinygltf::Material& given, const std::string& what,
                               Textures& textures, Material& material) {
  const tinygltf::Value transmission = extension(given.extensions, "KHR_materials_transmission");
  material.transmission = within(number(transmission, "transmissionFactor", 0), 0, 1,
                                 what + ": transmissionFactor", notes_);
  if (material.transmission > 0 &&
      !textures.take(transmission, "transmissionTexture", Encoding::linear,
                     &Material::transmission_texture)) {
    leave_out(what, "KHR_materials_transmission");
    material.transmission = 0;
  }

  const tinygltf::Value volume = extension(given.extensions, "KHR_materials_volume");
  // How thick it is where is for renderers that do not follow light through the mesh.
  material.thin_walled = !(number(volume, "thicknessFactor", 0) > 0);
  material.attenuation_color = color_within(numbers(volume, "attenuationColor", {1, 1, 1}), 1,
                                            what + ": attenuationColor", notes_);
  const double distance_m = number(volume, "attenuationDistance", max_distance_m);
  if (distance_m > 0 && distance_m < max_distance_m)
    material.attenuation_distance_m = static_cast<float>(distance_m);
  else if (distance_m <= 0)
    notes_.add(what + ": attenuationDistance must be greater than 0; infinite used");
}

void GltfMaterials::read_clearcoat(const tinygltf::Material& given, const std::string& what,
                                   Textures& textures, Material& material) {
  const tinygltf::Value lacquer = extension(given.extensions, "KHR_materials_clearcoat");
  material.clearcoat =
      within(number(lacquer, "clearcoatFactor", 0), 0, 1, what + ": clearcoatFactor", notes_);
  material.clearcoat_roughness = within(number(lacquer, "clearcoatRoughnessFactor", 0), 0, 1,
                                        what + ": clearcoatRoughnessFactor", notes_);
  if (material.clearcoat <= 0) return;
  if (!textures.take(lacquer, "clearcoatTexture", Encoding::linear, &Material::clearcoat_texture) ||
      !textures.take(lacquer, "clearcoatRoughnessTexture", Encoding::linear,
                     &Material::clearcoat_roughness_texture)) {
    leave_out(what, "KHR_materials_clearcoat");
    material.clearcoat = 0;
    return;
  }
  const std::string normals = "clearcoatNormalTexture";
  textures.take(lacquer, normals, Encoding::linear, &Material::clearcoat_normal_texture);
  if (lacquer.Has(normals) && lacquer.Get(normals).IsObject())
    material.clearcoat_normal_scale = within(number(lacquer.Get(normals), "scale", 1), -1e3, 1e3,
                                             what + ": " + normals + "'s scale", notes_);
}

void GltfMaterials::read_sheen(const tinygltf::Material& given, const std::string& what,
                               Textures& textures, Material& material) {
  const tinygltf::Value sheen = extension(given.extensions, "KHR_materials_sheen");
  material.sheen_color = color_within(numbers(sheen, "sheenColorFactor", {0, 0, 0}), 1,
                                      what + ": sheenColorFactor", notes_);
  const float roughness = within(number(sheen, "sheenRoughnessFactor", 0), 0, 1,
                                 what + ": sheenRoughnessFactor", notes_);
  material.sheen_roughness = std::max(roughness, gpu::LEAST_SHEEN_ROUGHNESS);
  if (!has_sheen(material)) return;
  if (roughness < material.sheen_roughness)
    notes_.add(what + ": its sheenRoughnessFactor is raised to " +
               std::to_string(gpu::LEAST_SHEEN_ROUGHNESS).substr(0, 4) + ", the supported minimum");
  if (textures.take(sheen, "sheenColorTexture", Encoding::srgb, &Material::sheen_color_texture) &&
      textures.take(sheen, "sheenRoughnessTexture", alpha_only, &Material::sheen_roughness_texture))
    return;
  leave_out(what, "KHR_materials_sheen");
  material.sheen_color = glm::vec3(0);
}

void GltfMaterials::read_specular(const tinygltf::Material& given, const std::string& what,
                                  Textures& textures, Material& material) {
  const tinygltf::Value specular = extension(given.extensions, "KHR_materials_specular");
  material.specular =
      within(number(specular, "specularFactor", 1), 0, 1, what + ": specularFactor", notes_);
  material.specular_color =
      color_within(numbers(specular, "specularColorFactor", {1, 1, 1}),
                   std::numeric_limits<float>::max(), what + ": specularColorFactor", notes_);
  if (!textures.take(specular, "specularTexture", alpha_only, &Material::specular_texture) ||
      !textures.take(specular, "specularColorTexture", Encoding::srgb,
                     &Material::specular_color_texture)) {
    leave_out(what, "KHR_materials_specular");
    material.specular = 1;
    material.specular_color = glm::vec3(1);
    material.specular_texture = material.specular_color_texture = no_texture;
  }
  if (material.transmission > 0 && has_specular_color(material))
    notes_.add(what + ": KHR_materials_specular does not colour the reflection of its glass");
}

void GltfMaterials::read_anisotropy(const tinygltf::Material& given, const std::string& what,
                                    Textures& textures, Material& material) {
  const tinygltf::Value anisotropy = extension(given.extensions, "KHR_materials_anisotropy");
  material.anisotropy = within(number(anisotropy, "anisotropyStrength", 0), 0, 1,
                               what + ": anisotropyStrength", notes_);
  material.anisotropy_rotation_rad = within(number(anisotropy, "anisotropyRotation", 0), -1e3, 1e3,
                                            what + ": anisotropyRotation", notes_);
  if (material.anisotropy <= 0) return;
  if (!is_anisotropic(material)) {
    notes_.add(what + ": it transmits light, so its anisotropy is ignored");
    return;
  }
  if (textures.take(anisotropy, "anisotropyTexture", Encoding::linear,
                    &Material::anisotropy_texture))
    return;
  leave_out(what, "KHR_materials_anisotropy");
  material.anisotropy = 0;
}

}  // namespace previz::scene
