
#include "tests/support/gltf_test.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test::gltf_look_test {

// What a material looks like where a part of the file is not read.
class GltfLooks : public GltfTest {
 protected:
  void use(Json material) {
    first_primitive()["material"] = gltf.add("materials", std::move(material));
  }
  GltfLooks() { gltf.root("a", gltf.triangle_mesh()); }
  static Json colored(int texture) {
    return {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}};
  }
};

const std::vector<unsigned char> two_texels = {0, 51, 255, 255, 10, 11, 128, 64};

// A tag of a studio, or ratified metadata, says nothing about the look.
TEST_F(GltfLooks, WithATagOfAnyProgramAreAsWithoutIt) {
  const int texture = gltf.texture(2, 1, two_texels);
  for (const char* extension : {"KHR_xmp_json_ld", "MY_studio_tag"})
    for (const Json& given :
         {Json{{"name", "paper"}}, Json{{"pbrMetallicRoughness", Json::object()}},
          Json{{"normalTexture", {{"index", texture}}}}}) {
      Json tagged = given;
      tagged["extensions"][extension] = {{"id", 7}};
      use(tagged);
      const scene::Scene scene = load();
      EXPECT_EQ(scene.materials.at(0).base_color, glm::vec3(1));
      EXPECT_EQ(scene.textures.size(), given.contains("normalTexture") ? 1u : 0u);
      EXPECT_EQ(std::ranges::count_if(scene.notes,
                                      [&](const std::string& note) {
                                        return note.find(extension) != std::string::npos;
                                      }),
                extension == std::string("MY_studio_tag") ? 1 : 0);
    }
}

// EXT_texture_webp: the texture's own source is the fallback.
TEST_F(GltfLooks, ReadsTheOtherPictureWhereTheWebpCannotBeRead) {
  gltf.add("images", image_of(png(1, 1, {9, 9, 9, 255})));
  gltf.add("images", {{"uri", "gone.webp"}});
  gltf.add("images", {{"uri", "data:image/webp;base64,UklGRiIAAABXRUJQVlA4TBYA"}});
  use(colored(0));
  for (const int image : {1, 2, 7}) {
    gltf.json["textures"] = {
        {{"source", 0}, {"extensions", {{"EXT_texture_webp", {{"source", image}}}}}}};
    const scene::Scene scene = load();
    EXPECT_EQ(scene.textures.at(0).width, 1) << image;
    EXPECT_THAT(scene.notes, Contains(HasSubstr("texture 0: its WebP is ignored for its other "
                                                "picture: ")))
        << image;
    gltf.json["textures"][0].erase("source");
    EXPECT_NE(error(), "") << image;
  }
}

// 2 x 2 texels of 16 bits in the seven passes of an interlaced PNG, which come in no order of rows.
TEST_F(GltfLooks, ReadsInterlacedPngs) {
  gltf.json["images"] = {
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAACEAIAAAHaQ3amAAAAIUlEQVR42mNg"
        "YGhg/P+fgYGRgYmBmYGBi0GEQQ7EZ2AAAERMBMB4pfRPAAAAAElFTkSuQmCC"}}};
  gltf.json["textures"] = {{{"source", 0}}};
  gltf.root("a", gltf.triangle_mesh(gltf.add(
                     "materials",
                     {{"pbrMetallicRoughness", {{"metallicRoughnessTexture", {{"index", 0}}}}}})));
  const auto texels = load().textures.at(0).texels;
  const glm::vec4 expected[] = {
      {0, 0x8001, 65535, 65535}, {1, 2, 3, 65535}, {10, 20, 30, 65535}, {65535, 0, 0, 65535}};
  ASSERT_EQ(texels.size(), 4u);
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < 4; ++c) EXPECT_FLOAT_EQ(texels[i][c], expected[i][c] / 65535) << i << c;
}

// Its specularFactor is (1, 1, 1) where there is none: a mirror.
TEST_F(GltfLooks, RefusesSpecularGlossinessWithoutTheTextureThatMakesItDark) {
  const int lost =
      gltf.add("textures", {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}});
  Json gloss = {{"diffuseFactor", {0, 0.2, 0, 1}},
                {"specularGlossinessTexture", {{"index", lost}}}};
  Json material;
  material["extensions"]["KHR_materials_pbrSpecularGlossiness"] = gloss;
  use(material);
  EXPECT_THAT(error(), HasSubstr("(KHR_texture_basisu), and without it a surface would be white"));
  gloss["specularFactor"] = {0.04, 0.04, 0.04};
  material["extensions"]["KHR_materials_pbrSpecularGlossiness"] = gloss;
  use(material);
  EXPECT_THAT(load().notes, Contains(HasSubstr("(KHR_texture_basisu); ignored")));
}

}  // namespace previz::test::gltf_look_test
