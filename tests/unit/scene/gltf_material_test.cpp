#include "daemon/core/scene/load_log.hpp"
#include "tests/support/gltf_test.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test::gltf_material_test {

class GltfMaterials : public GltfTest {
 protected:
  // A triangle with two sets of texture coordinates and the material given.
  void use(Json material) {
    const int index = gltf.add("materials", std::move(material));
    const Json attributes = {{"POSITION", gltf.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})},
                             {"TEXCOORD_0", gltf.uvs({{0, 0}, {1, 0}, {0, 1}})},
                             {"TEXCOORD_1", gltf.uvs({{0.5f, 0.5f}, {0.75f, 0}, {0, 0.75f}})}};
    add_mesh(attributes, {{"material", index}});
  }
  // The same with an image as its base colour.
  void use_image(Json image) {
    const int source = gltf.add("images", std::move(image));
    use(colored({{"index", gltf.add("textures", {{"source", source}})}}));
  }
  static Json colored(Json texture) {
    return {{"pbrMetallicRoughness", {{"baseColorTexture", std::move(texture)}}}};
  }
  // A material of one extension, whose name it has.
  static Json with(const char* extension, Json what) {
    return {{"name", extension}, {"extensions", {{extension, std::move(what)}}}};
  }
  scene::Material loaded(Json material) {
    use(std::move(material));
    return load().materials.at(0);
  }
};

const std::vector<unsigned char> two_texels = {0, 51, 255, 255, 10, 11, 128, 64};

TEST_F(GltfMaterials, DefaultsAreGltfs) {
  gltf.root("a", gltf.triangle_mesh());
  for (const scene::Material& m : {load().materials.at(0), loaded({{"name", "empty"}})}) {
    EXPECT_EQ(m.base_color, glm::vec3(1));
    EXPECT_EQ(m.metallic, 1);
    EXPECT_EQ(m.roughness, 1);
    EXPECT_EQ(m.specular, 1);
    EXPECT_EQ(m.specular_color, glm::vec3(1));
    EXPECT_EQ(m.sheen_color, glm::vec3(0));
    EXPECT_EQ(m.anisotropy, 0);
    EXPECT_EQ(m.ior, 1.5f);
    EXPECT_EQ(m.transmission, 0);
    EXPECT_TRUE(m.thin_walled);
    EXPECT_EQ(m.emission, glm::vec3(0));
    EXPECT_EQ(m.alpha_mode, scene::AlphaMode::opaque);
    EXPECT_EQ(m.attenuation_distance_m, std::numeric_limits<float>::infinity());
    EXPECT_EQ(m.base_color_texture, scene::no_texture);
  }
}

TEST_F(GltfMaterials, ReadsEveryFactor) {
  const scene::Material m = loaded(R"({
    "name": "all",
    "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                             "metallicFactor": 0.5, "roughnessFactor": 0.6},
    "emissiveFactor": [0.25, 0.5, 1],
    "alphaMode": "MASK",
    "alphaCutoff": 0.3,
    "extensions": {
      "KHR_materials_emissive_strength": {"emissiveStrength": 8},
      "KHR_materials_transmission": {"transmissionFactor": 0.9},
      "KHR_materials_ior": {"ior": 1.33},
      "KHR_materials_specular": {"specularFactor": 0.7},
      "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25},
      "KHR_materials_volume": {"thicknessFactor": 0.01, "attenuationColor": [0.8, 0.9, 1],
                               "attenuationDistance": 0.5}}})"_json);
  EXPECT_EQ(m.name, "all");
  EXPECT_EQ(m.base_color, glm::vec3(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(m.alpha, 0.4f);
  EXPECT_EQ(m.alpha_mode, scene::AlphaMode::mask);
  EXPECT_EQ(m.alpha_cutoff, 0.3f);
  EXPECT_EQ(m.metallic, 0.5f);
  EXPECT_EQ(m.roughness, 0.6f);
  EXPECT_EQ(m.emission, glm::vec3(2, 4, 8));
  EXPECT_EQ(m.transmission, 0.9f);
  EXPECT_EQ(m.ior, 1.33f);
  EXPECT_EQ(m.specular, 0.7f);
  EXPECT_EQ(m.clearcoat, 0.5f);
  EXPECT_EQ(m.clearcoat_roughness, 0.25f);
  EXPECT_FALSE(m.thin_walled);
  EXPECT_EQ(m.attenuation_color, glm::vec3(0.8f, 0.9f, 1));
  EXPECT_EQ(m.attenuation_distance_m, 0.5f);
}

// What the set knows better than the model: on real objects only, though a virtual one shares the
// file and the material.
TEST_F(GltfMaterials, SurfacesOfTheSetColourRealObjects) {
  object.presence = set::Presence::phantom;
  a_set.surfaces = {{"paint", {0.5, 0.25, 0.125}}};
  set::Object shown = object;
  shown.presence = set::Presence::virtual_object;
  shown.file = directory / "test.gltf";
  a_set.objects = {shown};
  use({{"name", "paint"}});
  const scene::Scene scene = load();
  ASSERT_EQ(scene.instances.size(), 2u);
  for (const scene::Instance& instance : scene.instances) {
    const bool real = (instance.presence & scene::world_real) != 0;
    EXPECT_EQ(scene.materials[instance.material].base_color,
              real ? glm::vec3(0.5f, 0.25f, 0.125f) : glm::vec3(1));
  }
  a_set.surfaces = {{"pain", {1, 1, 1}}};
  EXPECT_THAT(error(), HasSubstr("no real object has a material \"pain\"; there are \"paint\""));
}

TEST_F(GltfMaterials, OpaqueMeansAlphaOneAndThicknessZeroMeansThin) {
  const scene::Material m =
      loaded({{"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.4}}}},
              {"extensions", {{"KHR_materials_volume", {{"attenuationDistance", 1}}}}}});
  EXPECT_EQ(m.alpha, 1);
  EXPECT_TRUE(m.thin_walled);
}

// White light that went this far inside has the attenuation colour: exp(-sigma d) = colour.
TEST_F(GltfMaterials, ColourInsideOfGlassIsPerMetre) {
  const scene::Material m = loaded(R"({
    "pbrMetallicRoughness": {"metallicFactor": 0},
    "extensions": {
      "KHR_materials_transmission": {"transmissionFactor": 1},
      "KHR_materials_volume": {"thicknessFactor": 0.01, "attenuationColor": [0.1, 1, 0],
                               "attenuationDistance": 0.5}}})"_json);
  EXPECT_TRUE(scene::attenuates(m));
  const glm::vec3 sigma = scene::attenuation_per_m(m);
  EXPECT_FLOAT_EQ(sigma.r, -std::log(0.1f) / 0.5f);
  EXPECT_EQ(sigma.g, 0);
  EXPECT_TRUE(std::isfinite(sigma.b) && sigma.b > 100);  // black is finite, and leaves nothing
}

TEST_F(GltfMaterials, ReadsSheen) {
  const auto sheen_of = [](Json sheen) { return with("KHR_materials_sheen", std::move(sheen)); };
  const scene::Material m =
      loaded(sheen_of({{"sheenColorFactor", {0.25, 0.5, 1}}, {"sheenRoughnessFactor", 0.375}}));
  EXPECT_EQ(m.sheen_color, glm::vec3(0.25f, 0.5f, 1));
  EXPECT_EQ(m.sheen_roughness, 0.375f);
  EXPECT_TRUE(scene::has_sheen(m));
  use(sheen_of({{"sheenRoughnessFactor", 0.5}}));
  EXPECT_FALSE(scene::has_sheen(load().materials.at(1)));
  EXPECT_THAT(load().notes, IsEmpty());
  use(sheen_of({{"sheenColorFactor", {0, 2, 0}}}));
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr("sheen\": sheenColorFactor is out of range"),
                          HasSubstr("sheen\": its sheenRoughnessFactor is raised to 0.07")));
}

TEST_F(GltfMaterials, ReadsAnisotropy) {
  const auto anisotropy_of = [](Json anisotropy) {
    return with("KHR_materials_anisotropy", std::move(anisotropy));
  };
  const scene::Material m =
      loaded(anisotropy_of({{"anisotropyStrength", 0.5}, {"anisotropyRotation", -1.25}}));
  EXPECT_EQ(m.anisotropy, 0.5f);
  EXPECT_EQ(m.anisotropy_rotation_rad, -1.25f);
  EXPECT_TRUE(scene::is_anisotropic(m));
  // alpha = lerp(0.25, 1, 0.5^2)
  EXPECT_DOUBLE_EQ(scene::widest_alpha(m, 0.5), 0.4375);
  EXPECT_THAT(load().notes, IsEmpty());
  Json glass = anisotropy_of({{"anisotropyStrength", 1}});
  glass["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", 0.5}};
  use(glass);
  const int pan = gltf.add("materials", anisotropy_of({{"anisotropyStrength", 1}}));
  gltf.root("plain", gltf.triangle_mesh(pan));
  const scene::Scene scene = load();
  EXPECT_FALSE(scene::is_anisotropic(scene.materials.at(1)));
  EXPECT_THAT(
      scene.notes,
      ElementsAre(HasSubstr("anisotropy\": it transmits light, so its anisotropy is ignored"),
                  HasSubstr("has no TEXCOORD_0 for its anisotropy direction")));
}

TEST_F(GltfMaterials, ReadsTheColourOfGloss) {
  Json glass = with("KHR_materials_specular", {{"specularColorFactor", {4, 0.5, 0}}});
  EXPECT_EQ(loaded(glass).specular_color, glm::vec3(4, 0.5f, 0));
  EXPECT_THAT(load().notes, IsEmpty());
  glass["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", 1}};
  use(glass);
  EXPECT_THAT(
      load().notes,
      ElementsAre(HasSubstr("KHR_materials_specular does not colour the reflection of its glass")));
}

TEST_F(GltfMaterials, BringsNumbersIntoRangeWithANote) {
  use(R"({
    "name": "odd",
    "pbrMetallicRoughness": {"baseColorFactor": [2, 0.5, -1, 1], "metallicFactor": 7,
                             "roughnessFactor": -1},
    "extensions": {"KHR_materials_ior": {"ior": 0}}})"_json);
  const scene::Scene scene = load();
  const scene::Material& m = scene.materials.at(0);
  EXPECT_EQ(m.base_color, glm::vec3(1, 0.5f, 0));
  EXPECT_EQ(m.metallic, 1);
  EXPECT_EQ(m.roughness, 0);
  EXPECT_EQ(m.ior, 1);
  EXPECT_THAT(scene.notes,
              Contains(HasSubstr("material 0 \"odd\": its base colour is out of range; nearest "
                                 "allowed value used (2 times)")));
  EXPECT_EQ(scene.notes.size(), 4u);
}

TEST_F(GltfMaterials, DecodesColoursBySrgbAndDataAsTheyAre) {
  ASSERT_EQ(gltf.texture(2, 1, two_texels), 0);
  use(R"({
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
                             "metallicRoughnessTexture": {"index": 0}},
    "emissiveTexture": {"index": 0},
    "normalTexture": {"index": 0, "scale": 0.5}})"_json);
  const scene::Scene scene = load();
  const scene::Material& m = scene.materials.at(0);
  ASSERT_EQ(scene.textures.size(), 2u);  // one image, as colour and as data
  EXPECT_EQ(m.emission_texture, m.base_color_texture);
  EXPECT_EQ(m.normal_texture, m.metallic_roughness_texture);
  EXPECT_EQ(m.normal_scale, 0.5f);
  EXPECT_THAT(scene.notes, IsEmpty());
  const scene::Texture& color = scene.textures[m.base_color_texture];
  EXPECT_EQ(color.width, 2);
  EXPECT_EQ(color.height, 1);
  // IEC 61966-2-1: ((0.2 + 0.055) / 1.055)^2.4, and value / 12.92 up to 0.04045 (10 of 255).
  const auto srgb = [](double v) { return static_cast<float>(std::pow((v + 0.055) / 1.055, 2.4)); };
  EXPECT_EQ(color.texels[0], glm::vec4(0, srgb(0.2), 1, 1));
  EXPECT_EQ(color.texels[1], glm::vec4(static_cast<float>(10 / 255.0 / 12.92), srgb(11 / 255.0),
                                       srgb(128 / 255.0), static_cast<float>(64 / 255.0)));
  const scene::Texture& data = scene.textures[m.metallic_roughness_texture];
  EXPECT_EQ(data.texels[0], glm::vec4(0, 0.2f, 1, 1));
}

TEST_F(GltfMaterials, ReadsSamplers) {
  const auto sampled = [&](const Json& sampler) {
    return colored({{"index", gltf.texture(2, 1, two_texels, sampler)}});
  };
  use(sampled(Json::object()));
  use(sampled({{"magFilter", 9728}, {"wrapS", 33071}, {"wrapT", 33648}}));
  const scene::Scene scene = load();
  const scene::Texture& first = scene.textures.at(0);
  EXPECT_EQ(first.wrap_u, scene::Wrap::repeat);
  EXPECT_FALSE(first.nearest);
  const scene::Texture& second = scene.textures.at(1);
  EXPECT_EQ(second.wrap_u, scene::Wrap::clamp);
  EXPECT_EQ(second.wrap_v, scene::Wrap::mirror);
  EXPECT_TRUE(second.nearest);
}

TEST_F(GltfMaterials, MakesTextureCoordinatesOfTheSetAndTransformAsked) {
  const int texture = gltf.texture(2, 1, two_texels);
  const auto use_transformed = [&](Json transform) {
    use(colored(
        {{"index", texture}, {"extensions", {{"KHR_texture_transform", std::move(transform)}}}}));
  };
  use(colored({{"index", texture}, {"texCoord", 1}}));
  use_transformed({{"offset", {0.5, 0.25}}, {"scale", {2, 3}}});
  // The extension's own example: the lower left quadrant, turned.
  use_transformed({{"offset", {0, 1}}, {"rotation", std::numbers::pi / 2}, {"scale", {0.5, 0.5}}});
  use_transformed({{"texCoord", 1}});
  const scene::Scene scene = load();
  ASSERT_EQ(scene.meshes.size(), 4u);
  EXPECT_THAT(scene.meshes[0].uvs,
              ElementsAre(glm::vec2(0.5f, 0.5f), glm::vec2(0.75f, 0), glm::vec2(0, 0.75f)));
  EXPECT_THAT(scene.meshes[1].uvs,
              ElementsAre(glm::vec2(0.5f, 0.25f), glm::vec2(2.5f, 0.25f), glm::vec2(0.5f, 3.25f)));
  const auto expect_uv = [](const glm::vec2& uv, float u, float v) {
    EXPECT_NEAR(uv.x, u, 1e-7);  // half a last place of single precision at 1
    EXPECT_NEAR(uv.y, v, 1e-7);
  };
  expect_uv(scene.meshes[2].uvs[0], 0, 1);
  expect_uv(scene.meshes[2].uvs[1], 0, 0.5f);
  expect_uv(scene.meshes[2].uvs[2], 0.5f, 1);
  EXPECT_EQ(scene.meshes[3].uvs, scene.meshes[0].uvs);
  EXPECT_THAT(scene.notes, IsEmpty());
}

// A mesh has the coordinates of every mapping once, and the textures say which they are read by.
TEST_F(GltfMaterials, ReadsEveryTextureByItsOwnMapping) {
  ASSERT_EQ(gltf.texture(2, 1, two_texels), 0);
  use(R"({
    "name": "three",
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1},
                             "metallicRoughnessTexture": {"index": 0}},
    "emissiveTexture": {"index": 0,
                        "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}},
    "normalTexture": {"index": 0, "texCoord": 1},
    "extensions": {"KHR_materials_clearcoat": {
      "clearcoatFactor": 1,
      "clearcoatTexture": {"index": 0,
                           "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}}}}})"_json);
  const scene::Scene scene = load();
  const scene::Material& m = scene.materials.at(0);
  const auto mapping = [&](std::uint32_t scene::Material::*of) { return scene::mapping_of(m, of); };
  EXPECT_EQ(mapping(&scene::Material::base_color_texture), 0u);
  EXPECT_EQ(mapping(&scene::Material::normal_texture), 0u);
  EXPECT_EQ(mapping(&scene::Material::metallic_roughness_texture), 1u);
  EXPECT_EQ(mapping(&scene::Material::emission_texture), 2u);
  EXPECT_EQ(mapping(&scene::Material::clearcoat_texture), 2u);
  const scene::Mesh& mesh = scene.meshes.at(0);
  ASSERT_EQ(mesh.more_uvs.size(), 2u);
  EXPECT_EQ(mesh.uvs[1], glm::vec2(0.75f, 0));
  EXPECT_EQ(scene::uvs_of(mesh, 1)[1], glm::vec2(1, 0));
  EXPECT_EQ(scene::uvs_of(mesh, 2)[1], glm::vec2(2, 0));
  EXPECT_EQ(scene::uvs_of(mesh, 2)[2], glm::vec2(0, 3));
  EXPECT_THAT(scene.notes, IsEmpty());
}

// The files of KHR_materials_*: which texture, and in which encoding. An alpha is the same in
// either.
TEST_F(GltfMaterials, ReadsTheTexturesOfExtensions) {
  ASSERT_EQ(gltf.texture(2, 1, two_texels), 0);
  use(R"({"extensions": {
    "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 0}},
    "KHR_materials_clearcoat": {
      "clearcoatFactor": 1,
      "clearcoatTexture": {"index": 0},
      "clearcoatRoughnessTexture": {"index": 0},
      "clearcoatNormalTexture": {"index": 0, "scale": 0.5}},
    "KHR_materials_sheen": {
      "sheenColorFactor": [1, 1, 1], "sheenColorTexture": {"index": 0},
      "sheenRoughnessFactor": 1, "sheenRoughnessTexture": {"index": 0}},
    "KHR_materials_specular": {"specularTexture": {"index": 0},
                               "specularColorTexture": {"index": 0}}}})"_json);
  use(with("KHR_materials_anisotropy",
           {{"anisotropyStrength", 1}, {"anisotropyTexture", {{"index", 0}}}}));
  const scene::Scene scene = load();
  ASSERT_EQ(scene.textures.size(), 2u);  // one image, as colour and as data
  const scene::Material& m = scene.materials.at(0);
  const std::uint32_t data = m.transmission_texture, color = m.sheen_color_texture;
  EXPECT_EQ(scene.textures[data].texels[0].g, 0.2f);
  EXPECT_NE(scene.textures[color].texels[0].g, 0.2f);
  EXPECT_EQ(m.clearcoat_texture, data);
  EXPECT_EQ(m.clearcoat_roughness_texture, data);
  EXPECT_EQ(m.clearcoat_normal_texture, data);
  EXPECT_EQ(m.clearcoat_normal_scale, 0.5f);
  EXPECT_EQ(m.specular_color_texture, color);
  EXPECT_EQ(scene.textures[m.sheen_roughness_texture].texels[1].a, static_cast<float>(64 / 255.0));
  EXPECT_EQ(scene.textures[m.specular_texture].texels[1].a, static_cast<float>(64 / 255.0));
  EXPECT_EQ(scene.materials.at(1).anisotropy_texture, data);
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("does not colour the reflection of its glass")));
}

// What writes a factor of 1 beside a texture means the texture: without it nothing is glass.
TEST_F(GltfMaterials, LeavesOutExtensionsWhoseTextureCannotBeRead) {
  gltf.json["extensionsUsed"] = {"KHR_texture_basisu"};
  const Json lost = {
      {"index", gltf.add("textures", {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}})}};
  use(with("KHR_materials_transmission",
           {{"transmissionFactor", 1}, {"transmissionTexture", lost}}));
  use(with("KHR_materials_clearcoat",
           {{"clearcoatFactor", 1}, {"clearcoatRoughnessTexture", lost}}));
  use(with("KHR_materials_sheen", {{"sheenColorFactor", {1, 1, 1}},
                                   {"sheenRoughnessFactor", 1},
                                   {"sheenRoughnessTexture", lost}}));
  use(with(
      "KHR_materials_specular",
      {{"specularColorFactor", {2, 0, 0}}, {"specularFactor", 0.5}, {"specularTexture", lost}}));
  use(with("KHR_materials_anisotropy", {{"anisotropyStrength", 1}, {"anisotropyTexture", lost}}));
  const scene::Scene scene = load();
  EXPECT_EQ(scene.materials.at(0).transmission, 0);
  EXPECT_EQ(scene.materials.at(1).clearcoat, 0);
  EXPECT_FALSE(scene::has_sheen(scene.materials.at(2)));
  EXPECT_EQ(scene.materials.at(3).specular, 1);
  EXPECT_EQ(scene.materials.at(3).specular_color, glm::vec3(1));
  EXPECT_EQ(scene.materials.at(4).anisotropy, 0);
  for (const Json& material : gltf.json["materials"]) {
    const std::string name = material["name"];
    EXPECT_THAT(scene.notes, Contains(HasSubstr("\"" + name + "\": " + name + " is ignored, " +
                                                "because its texture cannot be read")));
  }
}

TEST_F(GltfMaterials, NotesTexturedMeshesWithoutCoordinates) {
  const Json textured = colored({{"index", gltf.texture(2, 1, two_texels)}});
  gltf.root("a", gltf.triangle_mesh(gltf.add("materials", textured)));
  const scene::Scene scene = load();
  EXPECT_THAT(scene.meshes.at(0).uvs, IsEmpty());
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("has no TEXCOORD_0 for its textures")));
}

TEST_F(GltfMaterials, ReadsImagesOfDataUrisAndOfFilesBeside) {
  const std::vector<unsigned char> bytes = png(2, 1, two_texels);
  session::write_content(directory / "my wood.png", {bytes.begin(), bytes.end()});
  use_image(image_of(bytes));
  use_image({{"uri", "my%20wood.png"}});
  const scene::Scene scene = load();
  ASSERT_EQ(scene.textures.size(), 2u);
  EXPECT_EQ(scene.textures[0].texels, scene.textures[1].texels);
}

TEST_F(GltfMaterials, Reads16BitPng) {
  // One grey texel of 0x8001: 1 x 1, 16 bit, colour type 0.
  const std::string encoded =
      "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABEAAAAABq7kcWAAAAC0lEQVR4nGNo"
      "YAQAAQQAgjmbwLoAAAAASUVORK5CYII=";
  gltf.add("images", {{"uri", "data:image/png;base64," + encoded}});
  gltf.add("textures", {{"source", 0}});
  use({{"pbrMetallicRoughness", {{"metallicRoughnessTexture", {{"index", 0}}}}}});
  const scene::Scene scene = load();
  const float grey = static_cast<float>(0x8001 / 65535.0);
  EXPECT_THAT(scene.textures.at(0).texels, ElementsAre(glm::vec4(grey, grey, grey, 1)));
}

TEST_F(GltfMaterials, NamesImagesThatCannotBeRead) {
  use_image({{"uri", "lost.png"}});
  const std::string file = (directory / "test.gltf").string();
  EXPECT_EQ(error(), file + ": image 0 \"lost.png\": not found; put it beside the file");
  EXPECT_EQ(error_with("/images/0", {{"name", "text"}, {"uri", "data:text/plain;base64,bm8hIQ=="}}),
            file + ": image 0 \"text\": is neither PNG, JPEG nor WebP; export it as PNG or JPEG");
  std::vector<unsigned char> broken = png(2, 1, two_texels);
  broken.at(42) ^= 0xff;  // the header of the compressed texels
  // Width in the PNG's header, big-endian at byte 16: larger than allowed, and more than its bytes.
  std::vector<unsigned char> huge = png(2, 1, two_texels), large = huge;
  huge[18] = 0x40;
  large[18] = large[22] = 0x04;
  expect_refused({{"/images/0", image_of(broken), "image 0: cannot be decoded"},
                  {"/images/0", image_of(huge), "image 0"},
                  {"/images/0", image_of(large), "is cut short"},
                  {"/images/0", {{"bufferView", 99}, {"mimeType", "image/png"}}, "image[0]"}});
}

// A PNG is a signature of 8 bytes and chunks of length, name, data and checksum, up to IEND;
// without the last of these and the checksum of the data before it, all texels are there.
TEST_F(GltfMaterials, RefusesPngsWhoseChunksGoOnAfterTheFile) {
  use_image(Json::object());
  const auto message_of = [&](const std::vector<unsigned char>& bytes) {
    return error_with("/images/0", image_of(bytes));
  };
  const std::vector<unsigned char> whole = png(2, 1, two_texels);
  for (std::size_t size = 34; size < whole.size() - 16; ++size)
    EXPECT_THAT(message_of({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}),
                HasSubstr("image 0: is cut short"))
        << size;
  for (const std::size_t length_at : {std::size_t{8}, std::size_t{33}}) {  // IHDR, IDAT
    std::vector<unsigned char> lying = whole;
    for (const unsigned char length : {0x58, 0xff}) {  // 1.5 GB, and beyond what a PNG may have
      lying.at(length_at) = length;
      EXPECT_THAT(message_of(lying),
                  AnyOf(HasSubstr("image 0: is cut short"), HasSubstr("it is a damaged PNG")));
    }
  }
  // The one checksum that no decoder needs.
  gltf.json["images"][0] = image_of({whole.begin(), whole.end() - 4});
  EXPECT_EQ(load().textures.at(0).width, 2);
}

// The texels of two_texels, without loss.
const char* const webp = "UklGRiIAAABXRUJQVlA4TBYAAAAvAQAAEA/wGexReOD/g/6DBxWI6H8A";

TEST_F(GltfMaterials, ReadsWebpWhetherItIsRequiredOrNot) {
  gltf.add("images", image_of(png(1, 1, {9, 9, 9, 255})));
  gltf.add("images", {{"uri", std::string("data:image/webp;base64,") + webp}});
  const Json of_webp = {{"EXT_texture_webp", {{"source", 1}}}};
  use(colored({{"index", gltf.add("textures", {{"extensions", of_webp}})}}));
  use(colored({{"index", gltf.add("textures", {{"source", 0}, {"extensions", of_webp}})}}));
  gltf.json["extensionsUsed"] = {"EXT_texture_webp"};
  for (const bool is_required : {false, true}) {
    if (is_required) gltf.json["extensionsRequired"] = {"EXT_texture_webp"};
    const scene::Scene scene = load();
    EXPECT_THAT(scene.notes, IsEmpty());
    ASSERT_EQ(scene.textures.size(), 1u);
    EXPECT_EQ(scene.textures[0].width, 2);
    EXPECT_EQ(scene.textures[0].texels[0].b, 1);
    EXPECT_FLOAT_EQ(scene.textures[0].texels[0].g, std::pow((0.2f + 0.055f) / 1.055f, 2.4f));
    EXPECT_EQ(scene.textures[0].texels[1].a, static_cast<float>(64 / 255.0));
  }
}

TEST_F(GltfMaterials, RefusesWebpThatIsDamagedAnimatedOrTooLarge) {
  use_image(Json::object());
  const auto message_of = [&](const std::vector<unsigned char>& bytes) {
    return error_with("/images/0", {{"uri", "data:image/webp;base64," + base64(bytes)}});
  };
  // A canvas of width and height less 1 in 24 bits each, with flags (Google's "WebP Container
  // Specification").
  const std::vector<unsigned char> canvas = {'R', 'I', 'F', 'F', 22,  0,   0,  0, 'W', 'E',
                                             'B', 'P', 'V', 'P', '8', 'X', 10, 0, 0,   0,
                                             2,   0,   0,   0,   1,   0,   0,  0, 0,   0};
  EXPECT_THAT(message_of(canvas), HasSubstr("image 0: is an animated WebP; export it as one"));
  // Without loss: a signature, then 14 bits each of width and height less 1.
  const auto picture_of = [](std::uint32_t side) {
    const std::uint32_t size = (side - 1) | (side - 1) << 14;
    std::vector<unsigned char> bytes = {'R', 'I', 'F', 'F', 34,  0,  0, 0, 'W', 'E', 'B',
                                        'P', 'V', 'P', '8', 'L', 22, 0, 0, 0,   0x2f};
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<unsigned char>(size >> 8 * i));
    bytes.resize(42);
    return bytes;
  };
  EXPECT_THAT(message_of(picture_of(16000)), HasSubstr("image 0: is cut short"));
  std::vector<unsigned char> broken = picture_of(2);
  std::ranges::fill(broken.begin() + 25, broken.end(), 0xff);
  EXPECT_THAT(message_of(broken), HasSubstr("image 0: cannot be decoded: it is a damaged WebP"));
  broken.resize(16);
  EXPECT_THAT(message_of(broken), HasSubstr("image 0: cannot be decoded: it is a damaged WebP"));
}

// What would be white without its texture is refused; bumps are left out with a note.
TEST_F(GltfMaterials, RefusesColoursInFormatsThatAreNotRead) {
  const std::string file = (directory / "test.gltf").string();
  const auto in_format = [&](const char* extension) {
    return Json{{"index", gltf.add("textures", {{"extensions", {{extension, {{"source", 0}}}}}})}};
  };
  use(colored(in_format("KHR_texture_basisu")));
  EXPECT_EQ(error(),
            file +
                ": texture 0: its picture is in a format that is not supported "
                "(KHR_texture_basisu), and without it a surface would be white; export the "
                "file with textures in PNG, JPEG or WebP");
  const Json none = {{"index", gltf.add("textures", Json::object())}};
  gltf.json["materials"][0] = colored(none);
  EXPECT_THAT(error(), HasSubstr("texture 1: has no picture, and without it a surface would be"));
  gltf.json["materials"][0] = colored(Json::object());
  EXPECT_THAT(error(), HasSubstr("material 0: its base colour texture names no texture"));
  gltf.json["materials"][0] = {{"emissiveFactor", {1, 1, 1}},
                               {"emissiveTexture", in_format("EXT_texture_avif")}};
  EXPECT_THAT(error(), HasSubstr("(EXT_texture_avif), and without it a surface would be white"));
  gltf.json["materials"][0] = {{"extensions", {{"KHR_techniques_webgl", {{"technique", 0}}}}}};
  EXPECT_THAT(error(),
              HasSubstr("material 0: its look is in the extension \"KHR_techniques_webgl\", "
                        "which is not supported, and without it the surface would be"));
  gltf.json["materials"][0] = {{"doubleSided", true},
                               {"normalTexture", in_format("MSFT_texture_dds")}};
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr("texture 3: its picture is in a format that is not supported "
                                    "(MSFT_texture_dds); ignored")));
}

// KHR_materials_pbrSpecularGlossiness: the reflectance at normal incidence is the specular colour,
// of paint that of its index of refraction, 0.04, times a colour.
TEST_F(GltfMaterials, ReadsSpecularGlossiness) {
  const auto glossy = [](Json gloss) {
    return with("KHR_materials_pbrSpecularGlossiness", std::move(gloss));
  };
  gltf.json["extensionsUsed"] =
      gltf.json["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"};
  Json matt = glossy({{"diffuseFactor", {0.25, 0.5, 0.75, 0.5}},
                      {"specularFactor", {0, 0, 0}},
                      {"glossinessFactor", 0.25}});
  matt["pbrMetallicRoughness"]["baseColorFactor"] = {1, 0, 0, 1};  // for who knows no extension
  matt["alphaMode"] = "BLEND";
  const scene::Material m = loaded(matt);
  EXPECT_THAT(load().notes, IsEmpty());
  EXPECT_EQ(m.base_color, glm::vec3(0.25f, 0.5f, 0.75f));
  EXPECT_EQ(m.alpha, 0.5f);
  EXPECT_EQ(m.metallic, 0);
  EXPECT_EQ(m.roughness, 0.75f);
  EXPECT_EQ(m.specular, 0);
  use(glossy({{"specularFactor", {0.04, 0.04, 0.04}}}));
  use(glossy({{"diffuseFactor", {0, 0, 0, 1}}, {"specularFactor", {1, 0.75, 0.5}}}));
  use(glossy({{"specularFactor", {0.01, 0.005, 0}}}));
  const scene::Scene scene = load();
  EXPECT_EQ(scene.materials[1].specular_color, glm::vec3(1));
  EXPECT_EQ(scene.materials[1].roughness, 0);
  const auto reflectance = [](const scene::Material& of) {
    return of.specular * 0.04f * of.specular_color;
  };
  EXPECT_NEAR(glm::distance(reflectance(scene.materials[2]), {1, 0.75f, 0.5f}), 0, 1e-6);
  EXPECT_EQ(scene.materials[2].specular, 1);
  EXPECT_NEAR(glm::distance(reflectance(scene.materials[3]), {0.01f, 0.005f, 0}), 0, 1e-8);
  EXPECT_EQ(scene.materials[3].specular, 0.25f);
}

TEST_F(GltfMaterials, ReadsTheTexturesOfSpecularGlossiness) {
  const int texture = gltf.texture(2, 1, two_texels);
  const scene::Material m = loaded(with("KHR_materials_pbrSpecularGlossiness",
                                        {{"diffuseTexture", {{"index", texture}}},
                                         {"specularGlossinessTexture", {{"index", texture}}},
                                         {"glossinessFactor", 0.5}}));
  const scene::Scene scene = load();
  EXPECT_THAT(scene.notes, IsEmpty());
  EXPECT_EQ(m.specular_color_texture, m.base_color_texture);
  EXPECT_EQ(m.roughness, 1);
  EXPECT_EQ(m.metallic, 0);
  const auto& texels = scene.textures.at(m.metallic_roughness_texture).texels;
  EXPECT_EQ(texels[0].g, 0.5f);  // 1 - 0.5 * 1
  EXPECT_FLOAT_EQ(texels[1].g, 1 - 0.5f * 64 / 255);
}

}  // namespace previz::test::gltf_material_test
