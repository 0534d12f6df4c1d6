// Textures that are looked up over the footprint of a sample: the levels of the pyramid, what a
// footprint covers, and that pictures converge to those of textures looked up at points.
#include "daemon/core/render/world/mip_levels.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::texture_filter_test {

set::Estimation filtered(int depth = 1) {
  return {.max_depth = depth, .filter_textures = true};
}

// Each texel is black or white by chance, or by turns.
scene::Texture patches(int side, bool by_turns, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  scene::Texture texture = texture_of(side, side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      texture.texels.emplace_back(
          glm::vec3((by_turns ? (x + y) % 2 : static_cast<int>(random() >> 31)) == 1 ? 1 : 0), 1);
  return texture;
}

constexpr int picture_side = 16;

// Looks straight down at a square of 1 m with the texture on it, of which a pixel shows 1/64 m. A
// distant lamp without a size lights it, so that no sample has any noise but that of the texture.
View seen_from_above(scene::Texture texture) {
  View view =
      empty_view({0, 0, 1}, {0, 0, 0}, pinhole(picture_side, picture_side, 2 * std::atan(0.125)));
  scene::Material material = diffuse(glm::vec3(1));
  material.base_color_texture = add_texture(view.scene, std::move(texture));
  add(view.scene, rectangle_mesh({1, 1}), material);
  // A white surface has a radiance of 1.
  view.scene.lights = {lamp(set::LightType::directional, glm::dvec3(std::numbers::pi))};
  return view;
}

std::vector<double> greens(const View& view, int samples, const set::Estimation& estimation) {
  std::vector<double> result;
  for (const glm::vec3& pixel : render_clean(view, samples, estimation).layers.mixed)
    result.push_back(pixel.g);
  return result;
}

double rms_error(const std::vector<double>& picture, const std::vector<double>& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < picture.size(); ++i)
    sum += (picture[i] - truth[i]) * (picture[i] - truth[i]);
  return std::sqrt(sum / static_cast<double>(picture.size()));
}

TEST(MipLevels, AreMeansOfAreasOfAnySize) {
  scene::Texture texture = texture_of(5, 3);
  glm::dvec4 sum(0);
  for (int i = 0; i < 15; ++i) {
    texture.texels.emplace_back(i, i * i, 1.0f / (1.0f + static_cast<float>(i)), 1);
    sum += glm::dvec4(texture.texels.back());
  }
  const std::vector<render::MipLevel> levels = render::mip_levels(texture);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].width, 2);
  EXPECT_EQ(levels[0].height, 1);
  EXPECT_EQ(levels[1].texels.size(), 1u);
  for (const render::MipLevel& level : levels) {
    glm::dvec4 mean(0);
    for (const glm::vec4& texel : level.texels) mean += glm::dvec4(texel);
    mean /= static_cast<double>(level.texels.size());
    EXPECT_LT(glm::length(mean - sum / 15.0), 1e-5 * glm::length(sum));
  }
  // Two columns and a half of 0 to 4, of the middle row 5: (0 + 1 + 2/2) / 2.5 + 5.
  EXPECT_NEAR(levels[0].texels[0].x, 5.8, 1e-5);
  texture.nearest = true;
  EXPECT_TRUE(render::mip_levels(texture).empty());
}

// A pixel shows 8x8 texels of a chequerboard, whose mean is exactly a half.
TEST(FilteredTextures, ShowTheMeanOfAPixelInItsFirstSample) {
  View view = seen_from_above(patches(512, true));
  const auto spread = [&](const set::Estimation& estimation) {
    const std::vector<double> picture = greens(view, 1, estimation);
    const auto [low, high] = std::ranges::minmax(picture);
    return high - low;
  };
  EXPECT_GT(spread(up_to_depth(1)), 0.5) << "black and white by chance";
  EXPECT_LT(spread(filtered()), 1e-3);
  scene::Material& board = view.scene.materials[0];
  board = emitter(glm::vec3(1));
  board.emission_texture = 0;
  EXPECT_GT(spread(up_to_depth(1)), 0.5);
  EXPECT_LT(spread(filtered()), 1e-3);
}

// Of 8x8 texels a pixel, each black or white by chance, a bilinear value has the variance
// (2/3)^2 / 4 = 0.111 and a mean over the pixel 1/256: a point is off from the pixel's mean by 0.33
// (rms), and a mean over an area of its size by at most sqrt(2/256) = 0.09.
TEST(FilteredTextures, BringTheFirstSampleThreeTimesAsNear) {
  const View view = seen_from_above(patches(512, false));
  const std::vector<double> truth = greens(view, 4096, up_to_depth(1));
  EXPECT_LT(rms_error(greens(view, 1, filtered()), truth),
            rms_error(greens(view, 1, up_to_depth(1)), truth) / 3);
}

// Many samples are as near to the truth as the bound of shaders/README.md, "Textures", asks, with a
// contrast of 1; noise is taken for four times what as many samples without a filter are off by.
TEST(FilteredTextures, ConvergeToThePictureWithoutAFilter) {
  for (const int texels : {96, 512}) {  // 1.5 and 8 a pixel
    const View view = seen_from_above(patches(texels, false));
    const std::vector<double> truth = greens(view, 4096, up_to_depth(1));
    for (const int samples : {16, 256}) {
      double harmonic = 0;
      for (int n = 1; n <= samples; ++n) harmonic += 1.0 / n;
      const double noise = 4 * rms_error(greens(view, samples, up_to_depth(1)), truth);
      const std::vector<double> picture = greens(view, samples, filtered());
      for (std::size_t i = 0; i < truth.size(); ++i)
        ASSERT_NEAR(picture[i], truth[i], 1.1 * harmonic / samples + noise)
            << texels << " texels, " << samples << " samples";
    }
  }
}

// Texels larger than pixels have no footprint; bit for bit.
TEST(FilteredTextures, AreAsTheyWereFromNear) {
  const View view = seen_from_above(patches(48, false));
  EXPECT_EQ(render_clean(view, 4, filtered()).layers.mixed,
            render_clean(view, 4, up_to_depth(1)).layers.mixed);
}

// A mask is there or not, and its colour belongs to what is there; a mirror is no mean of mirrors
// and matt metal.
TEST(FilteredTextures, AreReadAsTheyAreWhereATexelDecidesWhatASurfaceIs) {
  View view = seen_from_above(patches(512, false));
  scene::Material& leaf = view.scene.materials[0];
  for (glm::vec4& texel : view.scene.textures[0].texels) texel.a = texel.r;
  leaf.alpha_mode = scene::AlphaMode::mask;
  EXPECT_EQ(render_clean(view, 4, filtered()).layers.mixed,
            render_clean(view, 4, up_to_depth(1)).layers.mixed);
  leaf = metal(glm::vec3(0.9f), 1);
  leaf.metallic_roughness_texture = 0;
  for (glm::vec4& texel : view.scene.textures[0].texels) texel.b = 1;
  EXPECT_EQ(render_clean(view, 4, filtered(2)).layers.mixed,
            render_clean(view, 4, up_to_depth(2)).layers.mixed);
}

Estimate mean_of_renders(const View& view, set::Estimation estimation) {
  std::vector<glm::dvec3> means;
  for (estimation.seed = 1; estimation.seed <= 8; ++estimation.seed)
    means.push_back(mean(render_clean(view, 64, estimation).layers.mixed));
  return estimate_of(means);
}

// A floor in the light of a wall with a fine pattern, which its lobes see over wide footprints.
TEST(FilteredTextures, LightWhatIsAroundThemAlike) {
  View view = seen_from_above(patches(256, false));
  view.scene.materials[0].base_color_texture = scene::no_texture;
  view.scene.materials[0].base_color = glm::vec3(0.7f);
  scene::Material wall = emitter(glm::vec3(1));
  wall.emission_texture = 0;
  glm::dmat4 upright(1.0);
  upright[1] = glm::dvec4(0, 0, 1, 0);
  upright[2] = glm::dvec4(0, -1, 0, 0);
  upright[3] = glm::dvec4(0, 0.3, 0.5, 1);
  add(view.scene, rectangle_mesh({1, 1}), wall, upright);
  view.scene.lights.clear();
  const Estimate with = mean_of_renders(view, filtered(2));
  const Estimate without = mean_of_renders(view, up_to_depth(2));
  EXPECT_NEAR(with.mean.g, without.mean.g, 4 * std::hypot(with.error.g, without.error.g));
}

}  // namespace previz::test::texture_filter_test
