// The table of the extensions of materials, against what Khronos specifies and what the reader, the
// shaders and the renderer take from it.
#include "daemon/core/scene/material_extensions.hpp"

#include "daemon/core/render/world/feature.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::material_extensions_test {

using scene::Material;

// The keys of factors and textures in the extensions' schemas (glTF repository of Khronos,
// extensions/2.0/Khronos/*/schema), as far as they are read as such.
const std::map<std::string, std::set<std::string>> khronos_keys = {
    {"KHR_materials_anisotropy", {"anisotropyStrength", "anisotropyRotation", "anisotropyTexture"}},
    {"KHR_materials_clearcoat",
     {"clearcoatFactor", "clearcoatTexture", "clearcoatRoughnessFactor",
      "clearcoatRoughnessTexture", "clearcoatNormalTexture"}},
    {"KHR_materials_emissive_strength", {}},
    {"KHR_materials_ior", {"ior"}},
    {"KHR_materials_pbrSpecularGlossiness", {}},
    {"KHR_materials_sheen",
     {"sheenColorFactor", "sheenColorTexture", "sheenRoughnessFactor", "sheenRoughnessTexture"}},
    {"KHR_materials_specular",
     {"specularFactor", "specularTexture", "specularColorFactor", "specularColorTexture"}},
    {"KHR_materials_transmission", {"transmissionFactor", "transmissionTexture"}},
    {"KHR_materials_volume", {"attenuationColor"}}};

// The channels that the extensions' texts state.
const std::map<std::string, std::string> khronos_channels = {
    {"transmissionTexture", "r"},       {"clearcoatTexture", "r"},
    {"clearcoatRoughnessTexture", "g"}, {"sheenColorTexture", "rgb"},
    {"sheenRoughnessTexture", "a"},     {"specularTexture", "a"},
    {"specularColorTexture", "rgb"}};

std::vector<const scene::MaterialExtension*> read_rows() {
  std::vector<const scene::MaterialExtension*> rows;
  for (const scene::MaterialExtension& row : scene::material_extensions())
    if (!row.ignored) rows.push_back(&row);
  return rows;
}

TEST(MaterialExtensions, HaveTheKeysOfTheSpecification) {
  std::map<std::string, std::set<std::string>> keys;
  for (const auto* row : read_rows()) {
    std::set<std::string>& own = keys[row->name];
    for (const scene::Factor& factor : row->factors)
      EXPECT_TRUE(own.insert(factor.key).second) << factor.key;
    for (const scene::LayerTexture& texture : row->textures)
      EXPECT_TRUE(own.insert(texture.key).second) << texture.key;
  }
  EXPECT_EQ(keys, khronos_keys);
}

TEST(MaterialExtensions, AreRowsOnce) {
  std::set<std::string> names;
  for (const scene::MaterialExtension& row : scene::material_extensions()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_TRUE(!row.ignored || (row.factors.begin() == row.factors.end() &&
                                 row.textures.begin() == row.textures.end() && !row.feature))
        << row.name;
  }
}

// The textures of the core come first, and those of the rows are all others.
TEST(MaterialExtensions, HaveEachTextureOfALayerOnce) {
  std::vector<std::uint32_t Material::*> textures;
  for (const auto* row : read_rows())
    for (const scene::LayerTexture& texture : row->textures) textures.push_back(texture.texture);
  EXPECT_EQ(textures.size(), scene::material_textures.size() - scene::first_layer_texture);
  for (std::size_t i = scene::first_layer_texture; i < scene::material_textures.size(); ++i)
    EXPECT_EQ(std::ranges::count(textures, scene::material_textures[i]), 1) << i;
  for (const auto texture : textures)
    EXPECT_EQ(std::ranges::count(scene::material_textures, texture), 1);
}

TEST(MaterialExtensions, AreMultipliedByTheChannelsOfTheSpecification) {
  std::map<std::size_t, std::string> channels_of;
#define PREVIZ_KEEP_CHANNELS(layer, factor, channels) channels_of[gpu::layer] = #channels;
  PREVIZ_LAYER_TEXTURES(PREVIZ_KEEP_CHANNELS)
#undef PREVIZ_KEEP_CHANNELS
  std::map<std::string, std::string> channels;
  for (const auto* row : read_rows())
    for (const scene::LayerTexture& texture : row->textures) {
      const auto role = std::ranges::find(scene::material_textures, texture.texture);
      const auto place = static_cast<std::size_t>(role - scene::material_textures.begin());
      const auto found = channels_of.find(place - scene::first_layer_texture);
      if (found == channels_of.end()) continue;  // it gives a direction
      channels[texture.key] = found->second;
      if (found->second == "rgb") {
        EXPECT_EQ(texture.encoding, scene::Encoding::srgb) << texture.key;
      }
    }
  EXPECT_EQ(channels, khronos_channels);
}

// A feature's bit is one that nothing else has, and the renderer lists it with the same words.
TEST(MaterialExtensions, BringTheirFeatures) {
  std::size_t count = 0;
  for (const auto* row : read_rows()) {
    if (!row->feature) continue;
    ++count;
    EXPECT_EQ(std::popcount(row->feature->bit), 1) << row->name;
    const auto listed =
        std::ranges::find(render::features(), row->feature->bit, &render::Feature::bit);
    ASSERT_NE(listed, render::features().end()) << row->name;
    EXPECT_EQ(listed->name, row->feature->name);
    EXPECT_EQ(listed->used, row->feature->used);
    EXPECT_FALSE(row->feature->is_asked_for(Material{})) << row->name;
  }
  EXPECT_EQ(count, 4u);
  std::vector<std::string> names;
  for (const render::Feature& feature : render::features()) names.emplace_back(feature.name);
  const auto gloss = std::ranges::find(names, "gloss");
  ASSERT_GE(names.end() - gloss, 6);
  EXPECT_THAT(std::vector<std::string>(gloss, gloss + 6),
              ElementsAre("gloss", "coloured gloss", "brushed metal", "cloth", "lacquer", "metal"));
}

class ReadMaterialExtensions : public GltfTest {
 protected:
  scene::Scene load_with(const std::string& extension, Json given) {
    const int material =
        gltf.add("materials", {{"name", "m"}, {"extensions", {{extension, std::move(given)}}}});
    gltf.root("a", gltf.triangle_mesh(material));
    return load();
  }
};

// A file that requires one is loaded, without a note; one that is ignored is noted, with what is
// different.
TEST_F(ReadMaterialExtensions, AreSupportedOrNoted) {
  for (const scene::MaterialExtension& row : scene::material_extensions()) {
    gltf = GltfWriter();
    gltf.json["extensionsUsed"] = {row.name};
    gltf.json["extensionsRequired"] = {row.name};
    const scene::Scene scene = load_with(row.name, Json::object());
    if (!row.ignored) {
      EXPECT_THAT(scene.notes, IsEmpty()) << row.name;
      continue;
    }
    ASSERT_THAT(scene.notes, ElementsAre(HasSubstr(row.ignored))) << row.name;
    EXPECT_THAT(scene.notes[0], HasSubstr("which the file requires, is not supported"));
  }
}

// Each factor in turn, on both sides of its range, in a file of its own.
TEST_F(ReadMaterialExtensions, ClampTheirFactorsWithANote) {
  for (const auto* row : read_rows())
    for (const scene::Factor& factor : row->factors) {
      const bool is_color = factor.value.index() == 1;
      for (const double beyond : {factor.least - 1, 2 * factor.most + 1}) {
        if (beyond > std::numeric_limits<float>::max()) continue;  // there is no such limit
        gltf = GltfWriter();
        const scene::Scene scene = load_with(
            row->name, {{factor.key, is_color ? Json({beyond, beyond, beyond}) : Json(beyond)}});
        const Material& m = scene.materials.back();
        const double allowed = std::clamp(beyond, factor.least, factor.most);
        const float expected = std::max(static_cast<float>(allowed), factor.supported);
        const auto* const color = std::get_if<scene::Packed<glm::vec3>>(&factor.value);
        const glm::vec3 read =
            color ? m.*color->member : glm::vec3(m.*std::get<0>(factor.value).member);
        EXPECT_EQ(read, glm::vec3(expected)) << factor.key;
        ASSERT_FALSE(scene.notes.empty()) << factor.key;
        EXPECT_THAT(scene.notes[0],
                    HasSubstr("\"m\": " + std::string(factor.key) + " is out of range"));
      }
    }
}

}  // namespace previz::test::material_extensions_test
