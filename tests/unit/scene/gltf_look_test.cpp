#include <algorithm>

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
  static Json image_of(const std::vector<unsigned char>& bytes) {
    return {{"uri", "data:image/png;base64," + base64(bytes)}};
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

// A PNG's header has its size at byte 16, its bits at 24 and its kind of colour, 6: RGBA, at 25.
TEST_F(GltfLooks, SaysThat16BitsAreTooMany) {
  std::vector<unsigned char> large = png(2, 1, two_texels);
  large.at(16 + 2) = large.at(20 + 2) = 0x40;
  large.at(16 + 3) = large.at(20 + 3) = 0;
  large.at(24) = 16;
  large.resize(40000);
  EXPECT_EQ(large.at(25), 6);
  gltf.json["images"] = {image_of(large)};
  gltf.json["textures"] = {{{"source", 0}}};
  use(colored(0));
  EXPECT_THAT(error(),
              HasSubstr("image 0: is too large with 16 bits; export it with 8 bits, or 8192 wide"));
  large.at(24) = 8;
  EXPECT_THAT(error_with("/images/0", image_of(large)),
              AllOf(HasSubstr("image 0: cannot be decoded: "), Not(HasSubstr("SOI"))));
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
