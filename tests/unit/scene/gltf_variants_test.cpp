// Variants of a file's materials (KHR_materials_variants): by name, by number, and from damaged
// files.
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_variants_test {

using ::testing::AnyOf;

class GltfVariants : public GltfTest {
 protected:
  GltfVariants() {
    object.name = "vase";
    gltf.json["extensionsUsed"] = {"KHR_materials_variants"};
    gltf.json["extensions"]["KHR_materials_variants"]["variants"] =
        R"([{"name": "red"}, {"name": "blue"}])"_json;
    for (const char* name : {"plain", "red paint", "blue paint"})
      gltf.add("materials", {{"name", name}});
  }
  // A triangle of the first material with the mappings given; some have texture coordinates.
  void add_triangle(Json mappings, bool has_uvs = false) {
    Json attributes = {{"POSITION", gltf.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})}};
    if (has_uvs) attributes["TEXCOORD_0"] = gltf.uvs({{0, 0}, {1, 0}, {0, 1}});
    Json primitive = {{"material", 0}};
    if (!mappings.empty())
      primitive["extensions"]["KHR_materials_variants"]["mappings"] = std::move(mappings);
    add_mesh(attributes, primitive);
  }
  static Json painted() {
    return {{{"material", 1}, {"variants", {0}}}, {{"material", 2}, {"variants", {1}}}};
  }
  static std::string name_of(const scene::Scene& scene, const scene::Instance& instance) {
    return scene.materials[instance.material].name;
  }
};

TEST_F(GltfVariants, AreReadForEveryPrimitiveThatHasThem) {
  add_triangle(painted());
  add_triangle({});  // is plain in every variant
  const scene::Scene scene = load();
  EXPECT_THAT(scene.notes, IsEmpty());
  const scene::Variants* variants = scene::variants_of(scene, 0);
  ASSERT_NE(variants, nullptr);
  EXPECT_EQ(scene::variants_of(scene, 1), nullptr);
  EXPECT_THAT(variants->names, ElementsAre("red", "blue"));
  EXPECT_EQ(variants->own, "") << "no variant is plain";
  std::vector<scene::Instance> shown = scene.instances;
  const auto names = [&] {
    return std::vector<std::string>{name_of(scene, shown[0]), name_of(scene, shown[1])};
  };
  EXPECT_THAT(names(), ElementsAre("plain", "plain"));
  EXPECT_TRUE(scene::show_variant(*variants, "blue", shown));
  EXPECT_THAT(names(), ElementsAre("blue paint", "plain"));
  EXPECT_FALSE(scene::show_variant(*variants, "green", shown));
  EXPECT_THAT(names(), ElementsAre("blue paint", "plain"));
  EXPECT_TRUE(scene::show_variant(*variants, "", shown));
  EXPECT_THAT(names(), ElementsAre("plain", "plain"));
}

TEST_F(GltfVariants, TheSetChoosesOneByName) {
  add_triangle(painted());
  object.variant = "red";
  const scene::Scene scene = load();
  EXPECT_EQ(name_of(scene, scene.instances[0]), "red paint");
  std::vector<scene::Instance> shown = scene.instances;
  EXPECT_TRUE(scene::show_variant(scene.variants.at(0), "", shown));
  EXPECT_EQ(name_of(scene, shown[0]), "plain");
}

TEST_F(GltfVariants, OneThatIsNotThereIsRefusedWithThoseThatAre) {
  add_triangle(painted());
  object.variant = "green";
  EXPECT_THAT(error(), AllOf(HasSubstr("test.gltf: no variant \"green\""),
                             HasSubstr("it has \"red\", \"blue\"")));
  gltf.json["extensions"].erase("KHR_materials_variants");
  first_primitive().erase("extensions");
  EXPECT_THAT(error(), HasSubstr("no variant \"green\"; it has none"));
}

// Buttons change virtual objects only.
TEST_F(GltfVariants, OfRealObjectsOnlyTheChosenOneIsLoaded) {
  add_triangle(painted());
  object.presence = set::Presence::phantom;
  object.variant = "blue";
  const scene::Scene scene = load();
  EXPECT_THAT(scene.variants, IsEmpty());
  EXPECT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(name_of(scene, scene.instances[0]), "blue paint");
}

// As most exporters write it: the first variant is the file as it is.
TEST_F(GltfVariants, OneMayLookAsTheFileDoesWithoutIt) {
  add_triangle({{{"material", 0}, {"variants", {1}}}, {{"material", 2}, {"variants", {0}}}});
  EXPECT_EQ(load().variants.at(0).own, "blue");
}

// A mesh has one set of texture coordinates; the trees of both are built once, at the start.
TEST_F(GltfVariants, TexturesThatAreMappedOtherwiseTakeACopyOfTheMesh) {
  const int texture = gltf.texture(1, 1, {255, 255, 255, 255});
  gltf.json["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"] = {
      {"index", texture}, {"extensions", {{"KHR_texture_transform", {{"scale", {3, 3}}}}}}};
  add_triangle(painted(), true);
  const scene::Scene scene = load();
  ASSERT_EQ(scene.meshes.size(), 2u);
  EXPECT_EQ(scene.meshes[0].positions, scene.meshes[1].positions);
  std::vector<scene::Instance> shown = scene.instances;
  const auto last_uv = [&] { return scene.meshes[shown[0].mesh].uvs[2]; };
  EXPECT_EQ(last_uv(), glm::vec2(0, 1));
  scene::show_variant(scene.variants.at(0), "red", shown);
  EXPECT_EQ(last_uv(), glm::vec2(0, 3));
  scene::show_variant(scene.variants.at(0), "blue", shown);  // it has no texture
  EXPECT_EQ(shown[0].mesh, scene.instances[0].mesh);
}

TEST_F(GltfVariants, NamesThatAreMissingOrRepeatedBecomeNumbers) {
  gltf.json["extensions"]["KHR_materials_variants"]["variants"] = {
      {{"name", "red"}}, {{"name", "red"}}, {{"name", ""}}};
  add_triangle(Json::array({{{"material", 2}, {"variants", {1, 2}}}}));
  const scene::Scene scene = load();
  EXPECT_THAT(scene.variants.at(0).names, ElementsAre("red", "variant 2", "variant 3"));
  EXPECT_THAT(scene.notes,
              Contains(HasSubstr("variant 1 has no unique name; called \"variant 2\"")));
}

TEST_F(GltfVariants, DamagedOnesAreRefused) {
  add_triangle(painted());
  const char* mappings = "/meshes/0/primitives/0/extensions/KHR_materials_variants/mappings";
  for (const char* damaged :
       {R"([{"material": 1, "variants": [2]}])", R"([{"material": 1, "variants": [-1]}])",
        R"([{"material": 3, "variants": [0]}])", R"([{"variants": [0]}])",
        R"([{"material": 1, "variants": ["red"]}])"})
    EXPECT_THAT(error_with(mappings, Json::parse(damaged)),
                AnyOf(HasSubstr("which does not exist"), HasSubstr("a missing variant"),
                      HasSubstr("it must be a whole number")))
        << damaged;
}

}  // namespace previz::test::gltf_variants_test
