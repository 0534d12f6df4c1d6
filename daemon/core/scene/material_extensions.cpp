#include "daemon/core/scene/material_extensions.hpp"

namespace previz::scene {
namespace {

using gpu::GpuMaterial;

constexpr double most_float = std::numeric_limits<float>::max();
constexpr double max_attenuation_m = 1e15;  // attenuation is negligible beyond this
// Alpha is the same in either encoding; colours come in this one, often in the same image.
constexpr Encoding alpha_only = Encoding::srgb;

const char* read_volume(const GivenNumber& number, Material& m) {
  // How thick it is where is for renderers that do not follow light through the mesh.
  m.thin_walled = !(number("thicknessFactor", 0) > 0);
  const double distance_m = number("attenuationDistance", max_attenuation_m);
  if (distance_m > 0 && distance_m < max_attenuation_m)
    m.attenuation_distance_m = static_cast<float>(distance_m);
  return distance_m <= 0 ? "attenuationDistance must be greater than 0; infinite used" : nullptr;
}

constexpr MaterialExtension extension_rows[] = {
    // Read with the emission, which it multiplies.
    {.name = "KHR_materials_emissive_strength"},
    // Read in the place of metallic-roughness (gltf_material.hpp).
    {.name = "KHR_materials_pbrSpecularGlossiness"},
    // An ior of 0 stands for a Fresnel term of 1 and is there for old specular-glossiness assets.
    {.name = "KHR_materials_ior",
     .factors = {{{"ior", Packed{&Material::ior, &GpuMaterial::ior}, 1, 100}}}},
    {.name = "KHR_materials_transmission",
     .factors = {{{"transmissionFactor",
                   Packed{&Material::transmission, &GpuMaterial::transmission}}}},
     .textures = {{{"transmissionTexture", &Material::transmission_texture}}},
     .is_there = [](const Material& m) { return m.transmission > 0; }},
    {.name = "KHR_materials_volume",
     .factors = {{{"attenuationColor", Packed{&Material::attenuation_color}}}},
     .finish = read_volume},
    {.name = "KHR_materials_clearcoat",
     .factors = {{{"clearcoatFactor", Packed{&Material::clearcoat, &GpuMaterial::clearcoat}},
                  {"clearcoatRoughnessFactor",
                   Packed{&Material::clearcoat_roughness, &GpuMaterial::clearcoat_roughness}}}},
     .textures = {{{"clearcoatTexture", &Material::clearcoat_texture},
                   {"clearcoatRoughnessTexture", &Material::clearcoat_roughness_texture},
                   {"clearcoatNormalTexture", &Material::clearcoat_normal_texture, Encoding::linear,
                    &Material::clearcoat_normal_scale}}},
     .is_there = [](const Material& m) { return m.clearcoat > 0; },
     .feature = {{.name = "lacquer",
                  .bit = gpu::FEATURE_CLEARCOAT,
                  .is_asked_for = [](const Material& m) { return m.clearcoat > 0; },
                  .used = "a surface has a clear coat above its own"}}},
    {.name = "KHR_materials_sheen",
     .factors = {{{"sheenColorFactor", Packed{&Material::sheen_color, &GpuMaterial::sheen_color}},
                  {"sheenRoughnessFactor",
                   Packed{&Material::sheen_roughness, &GpuMaterial::sheen_roughness}, 0, 1,
                   gpu::LEAST_SHEEN_ROUGHNESS}}},
     .textures = {{{"sheenColorTexture", &Material::sheen_color_texture, Encoding::srgb},
                   {"sheenRoughnessTexture", &Material::sheen_roughness_texture, alpha_only}}},
     .is_there = has_sheen,
     .feature = {{.name = "cloth",
                  .bit = gpu::FEATURE_SHEEN,
                  .is_asked_for = has_sheen,
                  .used = "a surface has the soft shine of cloth where it is seen from the side"}}},
    {.name = "KHR_materials_specular",
     .factors = {{{"specularFactor", Packed{&Material::specular, &GpuMaterial::specular}},
                  {"specularColorFactor",
                   Packed{&Material::specular_color, &GpuMaterial::specular_color}, 0,
                   most_float}}},
     .textures = {{{"specularTexture", &Material::specular_texture, alpha_only},
                   {"specularColorTexture", &Material::specular_color_texture, Encoding::srgb}}},
     .finish = [](const GivenNumber&, Material& m) -> const char* {
       return m.transmission > 0 && has_specular_color(m)
                  ? "KHR_materials_specular does not colour the reflection of its glass"
                  : nullptr;
     },
     .feature = {{.name = "coloured gloss",
                  .bit = gpu::FEATURE_COAT_COLOR,
                  .is_asked_for =
                      [](const Material& m) { return has_coat(m) && has_specular_color(m); },
                  .used = "paint or plastic reflects in its own colour"}}},
    {.name = "KHR_materials_anisotropy",
     .factors = {{{"anisotropyStrength", Packed{&Material::anisotropy}},
                  {"anisotropyRotation", Packed{&Material::anisotropy_rotation_rad}, -1e3, 1e3}}},
     .textures = {{{"anisotropyTexture", &Material::anisotropy_texture}}},
     .is_there = is_anisotropic,
     .finish = [](const GivenNumber&, Material& m) -> const char* {
       return m.anisotropy > 0 && !is_anisotropic(m)
                  ? "it transmits light, so its anisotropy is ignored"
                  : nullptr;
     },
     .feature = {{.name = "brushed metal",
                  .bit = gpu::FEATURE_ANISOTROPY,
                  .is_asked_for =
                      [](const Material& m) {
                        return is_anisotropic(m) && (m.metallic > 0 || has_coat(m));
                      },
                  .used =
                      "a surface stretches highlights in one direction, as brushed metal does"}}},
    {.name = "KHR_materials_diffuse_transmission",
     .ignored = "leaves, paper and lampshades are dark where light comes from behind them"},
    {.name = "KHR_materials_dispersion", .ignored = "glass does not split light into its colours"},
    {.name = "KHR_materials_iridescence",
     .ignored = "soap bubbles and films of oil do not change colour with the angle of view"},
    {.name = "KHR_materials_unlit", .ignored = "unlit materials are lit like all others"}};

// A row with textures has a word here.
constexpr MaterialFeature layer_textures = {
    .name = "textures of layers",
    .bit = gpu::FEATURE_LAYER_TEXTURES,
    .is_asked_for =
        [](const Material& m) {
          for (std::size_t i = first_layer_texture; i < material_textures.size(); ++i)
            if (m.*material_textures[i] != no_texture) return true;
          return false;
        },
    .used = "an image says where a surface is glass, glossy, lacquered, brushed or cloth"};

// The shaders know a layer's texture by its place among the material's.
static_assert(first_layer_texture == gpu::TEXTURE_OF_LAYERS &&
              material_textures.size() == gpu::TEXTURE_OF_LAYERS + gpu::LAYERS);
#define PREVIZ_CHECK_PLACE(layer, factor, channels)                       \
  static_assert(material_textures[gpu::TEXTURE_OF_LAYERS + gpu::layer] == \
                &Material::factor##_texture);
PREVIZ_LAYER_TEXTURES(PREVIZ_CHECK_PLACE)
#undef PREVIZ_CHECK_PLACE

}  // namespace

std::span<const MaterialExtension> material_extensions() {
  return extension_rows;
}

const MaterialFeature& layer_texture_feature() {
  return layer_textures;
}

}  // namespace previz::scene
