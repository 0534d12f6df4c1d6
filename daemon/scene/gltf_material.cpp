#include "daemon/scene/gltf_material.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "daemon/scene/gltf_value.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::scene {
namespace {

constexpr double max_radiance = 1e30;
constexpr double max_distance_m = 1e15;  // attenuation is negligible beyond this

template <typename TextureInfo>
UvMapping mapping_of(const TextureInfo& texture, const std::string& what, Notes& notes) {
  const tinygltf::Value transform = extension(texture.extensions, "KHR_texture_transform");
  UvMapping mapping;
  const double set = number(transform, "texCoord", texture.texCoord);
  if (set == 0 || set == 1)
    mapping.set = static_cast<int>(set);
  else
    notes.add(what + ": texture coordinate sets other than 0 and 1 are not supported; set 0 taken");
  const std::vector<double> offset = numbers(transform, "offset", {0, 0});
  const std::vector<double> scale = numbers(transform, "scale", {1, 1});
  const double rotation = number(transform, "rotation", 0);
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
    notes.add(what + ": alphaMode \"" + set::printable(mode) + "\" is not known; OPAQUE taken");
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
                ", which is not there");
  const tinygltf::Material& given = model_.materials[static_cast<std::size_t>(index)];
  at->second =
      read(given, "material " + std::to_string(index) + " \"" + set::printable(given.name) + "\"");
  return at->second;
}

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
  read_extensions(given, what, material);

  std::optional<UvMapping> mapping;
  const auto texture = [&](const auto& info, Encoding encoding, const std::string& which) {
    if (info.index < 0) return no_texture;
    const UvMapping wanted = mapping_of(info, what + ", " + which, notes_);
    if (mapping && *mapping != wanted) {
      notes_.add(what + ": its " + which +
                 " is mapped otherwise than the textures before it; left out");
      return no_texture;
    }
    const std::uint32_t index = textures_.use(info.index, encoding);
    if (index != no_texture) mapping = wanted;
    return index;
  };
  material.base_color_texture =
      texture(pbr.baseColorTexture, Encoding::srgb, "base colour texture");
  material.metallic_roughness_texture =
      texture(pbr.metallicRoughnessTexture, Encoding::linear, "metallic-roughness texture");
  material.emission_texture = texture(given.emissiveTexture, Encoding::srgb, "emission texture");
  material.normal_texture = texture(given.normalTexture, Encoding::linear, "normal texture");
  material.normal_scale =
      within(given.normalTexture.scale, -1e3, 1e3, what + ": its normal texture's scale", notes_);
  // Occlusion textures are not left out: path tracing finds occlusion itself.

  const auto index = static_cast<std::uint32_t>(scene_.materials.size());
  scene_.materials.push_back(std::move(material));
  return {index, mapping.value_or(UvMapping{}), mapping.has_value()};
}

void GltfMaterials::read_extensions(const tinygltf::Material& given, const std::string& what,
                                    Material& material) {
  const tinygltf::Value ior = extension(given.extensions, "KHR_materials_ior");
  // An ior of 0 stands for a Fresnel term of 1 and is there for old specular-glossiness assets.
  material.ior = within(number(ior, "ior", 1.5), 1, 100, what + ": ior", notes_);

  const tinygltf::Value specular = extension(given.extensions, "KHR_materials_specular");
  material.specular =
      within(number(specular, "specularFactor", 1), 0, 1, what + ": specularFactor", notes_);
  material.specular_color =
      color_within(numbers(specular, "specularColorFactor", {1, 1, 1}),
                   std::numeric_limits<float>::max(), what + ": specularColorFactor", notes_);
  if (specular.Has("specularTexture") || specular.Has("specularColorTexture"))
    notes_.add(what + ": the textures of KHR_materials_specular are not supported; left out");

  const tinygltf::Value transmission = extension(given.extensions, "KHR_materials_transmission");
  material.transmission = within(number(transmission, "transmissionFactor", 0), 0, 1,
                                 what + ": transmissionFactor", notes_);
  if (transmission.Has("transmissionTexture"))
    notes_.add(what + ": its transmission texture is not supported; left out");

  const tinygltf::Value volume = extension(given.extensions, "KHR_materials_volume");
  material.thin_walled = !(number(volume, "thicknessFactor", 0) > 0);
  material.attenuation_color = color_within(numbers(volume, "attenuationColor", {1, 1, 1}), 1,
                                            what + ": attenuationColor", notes_);
  const double distance_m = number(volume, "attenuationDistance", max_distance_m);
  if (distance_m > 0 && distance_m < max_distance_m)
    material.attenuation_distance_m = static_cast<float>(distance_m);
  else if (distance_m <= 0)
    notes_.add(what + ": attenuationDistance must be greater than 0; taken as infinite");

  read_sheen(given, what, material);
  read_anisotropy(given, what, material);
  if (material.transmission > 0 && material.specular_color != glm::vec3(1))
    notes_.add(what + ": specularColorFactor does not colour the reflection of glass");

  const tinygltf::Value lacquer = extension(given.extensions, "KHR_materials_clearcoat");
  material.clearcoat =
      within(number(lacquer, "clearcoatFactor", 0), 0, 1, what + ": clearcoatFactor", notes_);
  material.clearcoat_roughness = within(number(lacquer, "clearcoatRoughnessFactor", 0), 0, 1,
                                        what + ": clearcoatRoughnessFactor", notes_);
  if (material.clearcoat > 0 &&
      (lacquer.Has("clearcoatTexture") || lacquer.Has("clearcoatRoughnessTexture") ||
       lacquer.Has("clearcoatNormalTexture")))
    notes_.add(what + ": the textures of its clear coat are not supported; left out");
  if (material.clearcoat > 0 && given.normalTexture.index >= 0)
    notes_.add(what + ": its clear coat follows its normal texture");
}

void GltfMaterials::read_sheen(const tinygltf::Material& given, const std::string& what,
                               Material& material) {
  const tinygltf::Value sheen = extension(given.extensions, "KHR_materials_sheen");
  material.sheen_color = color_within(numbers(sheen, "sheenColorFactor", {0, 0, 0}), 1,
                                      what + ": sheenColorFactor", notes_);
  const float roughness = within(number(sheen, "sheenRoughnessFactor", 0), 0, 1,
                                 what + ": sheenRoughnessFactor", notes_);
  material.sheen_roughness = std::max(roughness, gpu::LEAST_SHEEN_ROUGHNESS);
  if (!has_sheen(material)) return;
  if (roughness < material.sheen_roughness)
    notes_.add(what + ": its sheenRoughnessFactor is taken as " +
               std::to_string(gpu::LEAST_SHEEN_ROUGHNESS).substr(0, 4) +
               ", the least that is supported");
  if (sheen.Has("sheenColorTexture") || sheen.Has("sheenRoughnessTexture"))
    notes_.add(what + ": the textures of its sheen are not supported; left out");
}

void GltfMaterials::read_anisotropy(const tinygltf::Material& given, const std::string& what,
                                    Material& material) {
  const tinygltf::Value anisotropy = extension(given.extensions, "KHR_materials_anisotropy");
  material.anisotropy = within(number(anisotropy, "anisotropyStrength", 0), 0, 1,
                               what + ": anisotropyStrength", notes_);
  material.anisotropy_rotation_rad = within(number(anisotropy, "anisotropyRotation", 0), -1e3, 1e3,
                                            what + ": anisotropyRotation", notes_);
  if (material.anisotropy <= 0) return;
  if (anisotropy.Has("anisotropyTexture"))
    notes_.add(what + ": the texture of its anisotropy is not supported; left out");
  if (!is_anisotropic(material))
    notes_.add(what + ": as it lets light through, its anisotropy is left out");
}

}  // namespace previz::scene
