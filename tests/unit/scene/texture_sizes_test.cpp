#include "daemon/core/scene/texture_sizes.hpp"

#include "tests/support/gltf_test.hpp"

namespace previz::test::texture_sizes_test {

using scene::PictureSize;

TEST(TextureSizes, AreHalvedFromTheLargestUntilAllFit) {
  using Sizes = std::vector<PictureSize>;
  const Sizes three(3, {8192, 8192});
  EXPECT_EQ(scene::fitted_sizes(three, false, 3ull << 26), three);
  EXPECT_EQ(scene::fitted_sizes(three, false, scene::max_texels),
            (Sizes{{8192, 8192}, {4096, 4096}, {4096, 4096}}));
  EXPECT_EQ(scene::fitted_sizes({{16384, 16384}, {64, 64}}, false, scene::max_texels),
            (Sizes{{8192, 8192}, {64, 64}}));
  EXPECT_EQ(scene::fitted_sizes({{7, 1}, {1, 9}}, false, 2), (Sizes{{1, 1}, {1, 1}}));
  EXPECT_EQ(scene::fitted_sizes({{7, 1}, {1, 9}}, false, 0), (Sizes{{1, 1}, {1, 1}}));
}

// The levels of 2^27 texels have a third more.
TEST(TextureSizes, CountTheLevelsOfTexturesThatAreFiltered) {
  const std::vector<PictureSize> whole{{16384, 8192}};
  EXPECT_EQ(scene::fitted_sizes(whole, false, scene::max_texels), whole);
  EXPECT_EQ(scene::fitted_sizes(whole, true, scene::max_texels),
            (std::vector<PictureSize>{{8192, 4096}}));
}

class TextureBudget : public GltfTest {
 protected:
  // A texture of white and black columns, and its material.
  void use(int side, const char* key) {
    std::vector<unsigned char> rgba;
    for (int i = 0; i < side * side; ++i)
      for (int c = 0; c < 4; ++c) rgba.push_back(c == 3 || i % 2 == 0 ? 255 : 0);
    const int texture = gltf.texture(side, side, rgba);
    gltf.root("a", gltf.triangle_mesh(gltf.add(
                       "materials",
                       {{"name", "m"}, {"pbrMetallicRoughness", {{key, {{"index", texture}}}}}})));
  }
  scene::Scene load_with(std::uint64_t most_texels) {
    gltf.save(directory / "test.gltf");
    return scene::load_scene(set_of(directory / "test.gltf"), most_texels);
  }
};

TEST_F(TextureBudget, WhatIsOverItIsReducedInLinearLightWithANote) {
  use(8, "baseColorTexture");
  use(8, "metallicRoughnessTexture");
  use(4, "baseColorTexture");
  const scene::Scene whole = load_with(144);
  const scene::Scene reduced = load_with(143);
  ASSERT_EQ(whole.textures.size(), 3u);
  ASSERT_EQ(reduced.textures.size(), 3u);
  EXPECT_EQ(reduced.textures[0], whole.textures[0]);  // to the bit
  EXPECT_EQ(reduced.textures[2], whole.textures[2]);
  EXPECT_EQ(reduced.textures[1].width, 4);
  EXPECT_EQ(reduced.textures[1].height, 4);
  EXPECT_THAT(reduced.textures[1].texels, ::testing::Each(glm::vec4(0.5f, 0.5f, 0.5f, 1)));
  const auto said = HasSubstr(
      "1 texture is reduced, \"image 1\" of 8 x 8 pixels to 4 x 4: the textures of the scene have "
      "more than 143 pixels together, as two of 8 x 8 have; to choose their sizes, use "
      "gltf-transform resize IN OUT --width 4 --height 4");
  EXPECT_THAT(whole.notes, Not(Contains(said)));
  EXPECT_THAT(reduced.notes, Contains(said));
  // Half of the area is white: half of the light, whatever the code of that is.
  EXPECT_THAT(load_with(3).textures.at(0).texels, ElementsAre(glm::vec4(0.5f, 0.5f, 0.5f, 1)));
}

TEST_F(TextureBudget, ManyAreSaidInOneNote) {
  for (int i = 0; i < 5; ++i) use(8, "baseColorTexture");
  const auto notes = load_with(100).notes;
  EXPECT_THAT(notes, Contains(HasSubstr("5 textures are reduced, \"image 0\" of 8 x 8 pixels to 4 "
                                        "x 4, \"image 1\" of 8 x 8 pixels to 4 x 4, \"image 2\" of "
                                        "8 x 8 pixels to 4 x 4 and 2 more: ")));
  EXPECT_EQ(std::ranges::count_if(
                notes, [](const std::string& note) { return note.find("reduced") != note.npos; }),
            1);
}

// An opaque material shows the colours of texels whose alpha is 0.
TEST_F(TextureBudget, AlphaCountsWhereItCutsOut) {
  const int texture = gltf.texture(2, 1, {0, 255, 0, 255, 0, 0, 0, 0});
  const auto green = [&](const char* mode) {
    gltf.json["materials"] = {
        {{"alphaMode", mode},
         {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}}};
    return load_with(1).textures.at(0).texels.at(0).g;
  };
  gltf.root("a", gltf.triangle_mesh(0));
  EXPECT_EQ(green("OPAQUE"), 0.5f);
  EXPECT_NEAR(green("MASK"), 1, 1e-5);
  EXPECT_NEAR(green("BLEND"), 1, 1e-5);
}

// What is not covered has no colour: a leaf on black keeps its green, a fifth of red counts a
// fifth. Where nothing is covered, the colours count alike.
TEST_F(TextureBudget, AverageColoursByWhatTheyCover) {
  const std::vector<unsigned char> leaf = {0, 255, 0, 255, 0, 0, 0, 0};
  const std::vector<unsigned char> glaze = {255, 0, 0, 51, 0, 0, 0, 0};
  const std::vector<unsigned char> nothing = {255, 0, 0, 0, 0, 0, 0, 0};
  std::vector<unsigned char> rgba;
  for (const auto& row : {leaf, glaze, nothing, nothing})
    rgba.insert(rgba.end(), row.begin(), row.end());
  gltf.json["materials"] = {
      {{"alphaMode", "MASK"},
       {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", gltf.texture(2, 4, rgba)}}}}}}};
  gltf.root("a", gltf.triangle_mesh(0));
  const auto texels = load_with(2).textures.at(0).texels;
  ASSERT_EQ(texels.size(), 2u);
  const glm::vec4 expected[] = {{1 / 6.0f, 5 / 6.0f, 0, 0.3f}, {0.5f, 0, 0, 0}};
  for (int i = 0; i < 2; ++i)
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(texels[i][c], expected[i][c], 1e-5) << i << c;
}

}  // namespace previz::test::texture_sizes_test
