// The picture made on the device is that of the layers, whatever they are composited by.
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::show_test {

// What the device must come to, in double precision.
Plate reference(const render::Layers& layers, const Plate& plate, int bits, double exposure) {
  const lighting::Response response({}, bits);
  Plate picture{layers.width, layers.height, bits, {}};
  for (std::size_t i = 0; i < layers.composite.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const std::size_t at = 3 * i + static_cast<std::size_t>(c);
      const float composite = layers.composite[i][c];
      const bool untouched =
          layers.mask[i] == 0 && !plate.samples.empty() &&
          composite == static_cast<float>(response.inverse()[plate.samples[at]] / exposure);
      picture.samples.push_back(untouched
                                    ? plate.samples[at]
                                    : response.forward(exposure * static_cast<double>(composite)));
    }
  return picture;
}

// Single precision is off by 8 roundings of 6e-8 or so of what is added, which is near what is
// shown where the two worlds are no farther apart than that; and a response is no steeper than 2
// but near black, where there is less to round. So by 1e-6 of the largest code, which is less than
// one, and where a sample is that near to the next code on either side.
void expect_same_but_for_rounding(const Plate& a, const Plate& b) {
  ASSERT_EQ(a.bits, b.bits);
  ASSERT_EQ(a.width, b.width);
  ASSERT_EQ(a.samples.size(), b.samples.size());
  double others = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    ASSERT_NEAR(a.samples[i], b.samples[i], 1) << i;
    others += a.samples[i] != b.samples[i] ? 1 : 0;
  }
  EXPECT_LE(others, 2 * 1e-6 * (1 << a.bits) * static_cast<double>(a.samples.size()));
}

class ShowOf : public ::testing::TestWithParam<set::Composite> {};
INSTANTIATE_TEST_SUITE_P(Composites, ShowOf,
                         ::testing::Values(set::Composite::additive, set::Composite::ratio,
                                           set::Composite::hybrid));

TEST_P(ShowOf, ASetIsThePictureOfItsLayers) {
  View view = random_scene(3, {.width = 71, .height = 49});  // an odd number of pixels
  // The denoiser keeps photons' light apart and divides by the albedo of a scene with textures:
  // both are in no layer.
  const set::Estimation estimation{.composite = GetParam(), .caustics = set::Caustics::traced};
  for (scene::Material& material : view.scene.materials)
    material.base_color_texture = material.metallic_roughness_texture = material.emission_texture =
        scene::no_texture;
  SetRenderer renderer(view, estimation);
  for (const int bits : {8, 16})
    for (const int samples : {1, 5}) {
      SCOPED_TRACE(std::to_string(bits) + " bits, " + std::to_string(samples) + " samples");
      const Plate plate = random_plate(71, 49, bits);
      renderer.begin({std::make_shared<const Plate>(plate), 0.85, view.world_from_camera});
      renderer.render(samples);
      render::Layers layers = renderer.layers();
      expect_same_but_for_rounding(renderer.show(false, &layers),
                                   reference(layers, plate, bits, 0.85));
      EXPECT_FALSE(layers.denoised);
      render::Layers by_hand = layers;
      render::Denoiser denoiser(*shared_device());
      const lighting::Response response({}, bits);
      denoise(denoiser, by_hand, render::plate_radiance(plate, response, 0.85),
              {GetParam(), estimation.composite_floor / 0.85});
      const Plate shown = renderer.show(true, &layers);
      // What the two worlds differ by in a partly covered pixel is in no layer; such a pixel
      // changes no other.
      for (std::size_t i = 0; i < layers.mask.size(); ++i)
        if (layers.mask[i] > 0 && layers.mask[i] < 1) by_hand.composite[i] = layers.composite[i];
      // Nor has a layer all that the other rules multiply.
      if (GetParam() == set::Composite::additive)
        expect_same_but_for_rounding(shown, reference(by_hand, plate, bits, 0.85));
      expect_same_but_for_rounding(shown, reference(layers, plate, bits, 0.85));
      EXPECT_TRUE(layers.denoised);
      EXPECT_EQ(renderer.show(true).samples, shown.samples);
      expect_clean(renderer.counters());
    }
}

TEST(Show, WithoutAVirtualObjectIsThePlateBitForBit) {
  const View view = random_scene(3, {.width = 71, .height = 49, .virtual_objects = 0});
  for (const auto composite : all_composites) {
    SetRenderer renderer(view, {.composite = composite});
    for (const int bits : {8, 16}) {
      const Plate plate = random_plate(71, 49, bits);
      renderer.begin({std::make_shared<const Plate>(plate), 0.85, view.world_from_camera});
      renderer.render(2);
      EXPECT_EQ(renderer.show(false).samples, plate.samples) << bits << " bits";
      EXPECT_EQ(renderer.show(true).samples, plate.samples) << bits << " bits, denoised";
    }
  }
}

TEST_P(ShowOf, ASetIsOverBlackWhereThereIsNoPlate) {
  const View view = random_scene(4, {.width = 40, .height = 30});
  SetRenderer renderer(view, {.composite = GetParam()});
  render::Layers layers = renderer.rendered(3);
  expect_same_but_for_rounding(renderer.show(false), reference(layers, {}, 8, 1));
  const Plate shown = renderer.show(true, &layers);  // which denoises the layers
  expect_same_but_for_rounding(shown, reference(layers, {}, 8, 1));
}

TEST(Show, FollowsThePicturesSize) {
  View view = random_scene(4, {.width = 40, .height = 30});
  SetRenderer renderer(view);
  for (const auto& [width, height] : {std::pair(40, 30), std::pair(61, 47), std::pair(7, 5)}) {
    view.calibration.intrinsics.width = width;
    view.calibration.intrinsics.height = height;
    renderer.resize(view.calibration);
    const Plate plate = random_plate(width, height, 8);
    renderer.begin({std::make_shared<const Plate>(plate), 1.0, view.world_from_camera});
    renderer.render(2);
    render::Layers layers = renderer.layers();
    const Plate shown = renderer.show(true, &layers);
    expect_same_but_for_rounding(shown, reference(layers, plate, 8, 1));
  }
}

// A lamp in the camera's picture, beside noise that darkens it by less than a code of 8 bits: what
// was clipped stays white to the last bit, at exposures of which white is not the exact inverse.
TEST(Show, WhatTheSensorClippedStaysWhite) {
  constexpr int side = 16;
  const Plate plate{side, side, 16, std::vector<std::uint16_t>(3 * side * side, 65535)};
  const lighting::Response response({}, 16);
  for (const double exposure : {0.3, 0.85, 0.9, 7.0}) {
    std::vector<gpu::GpuPixel> pixels(side * side);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      // Every other pixel is as the camera saw it, the others are darker in one sample of four.
      const float diff = i % 2 == 0 ? 0 : -0.01f / static_cast<float>(exposure);
      pixels[i].diff_high = gpu::vec4(diff, diff, diff, 8);
      pixels[i].normal = gpu::vec4(0, 0, 4, 4);
      pixels[i].uncovered_high = gpu::vec4(4 * diff, 4 * diff, 4 * diff, 0);
      pixels[i].square_high = gpu::vec4(diff * diff, diff * diff, diff * diff, 4);
    }
    render::Denoiser denoiser(*shared_device());
    const Plate shown = present(pixels, plate, response, exposure, denoiser, true, side);
    for (std::size_t i = 0; i < shown.samples.size(); i += 6)
      EXPECT_EQ(shown.samples[i], 65535) << exposure << ", sample " << i;
  }
}

// One pixel of a picture that is noisy, half covered here and there, and too bright in places.
gpu::GpuPixel random_pixel(std::mt19937& random) {
  std::uniform_real_distribution<float> share(0, 1);
  gpu::GpuPixel pixel{};
  const float samples = 4;
  const bool covered = share(random) < 0.3f, changed = share(random) < 0.5f;
  const glm::vec3 mixed = glm::vec3(share(random), share(random), share(random)) * 1.3f;
  const glm::vec3 diff = changed ? 0.2f * (mixed - 0.5f) : glm::vec3(0);
  pixel.mixed_high = samples * glm::vec4(mixed, covered ? share(random) : 0);
  pixel.diff_high = samples * glm::vec4(diff, 2);
  pixel.normal = samples * glm::vec4(0, 0, 1, 1);
  const float mask = pixel.mixed_high.w / samples;
  pixel.uncovered_high = samples * glm::vec4((1 - mask) * diff, 0);
  pixel.square_high =
      samples * glm::vec4(1.1f * (mask * mixed * mixed + (1 - mask) * diff * diff), 1);
  return pixel;
}

// Tiles end where bands do not.
TEST(Show, DoesNotDependOnTilesAndBands) {
  constexpr int width = 37, height = 150;
  std::mt19937 random(1);
  std::vector<gpu::GpuPixel> pixels;
  for (int i = 0; i < width * height; ++i) pixels.push_back(random_pixel(random));
  const Plate plate = random_plate(width, height, 8);
  const lighting::Response response(ResponseCurve{}, 8);
  const auto shown = [&](int tile_rows, std::size_t band_pixels) {
    render::Denoiser denoiser(*shared_device(), band_pixels);
    EXPECT_EQ(denoiser.bands(width, height).size() > 1, band_pixels < pixels.size());
    return present(pixels, plate, response, 0.9, denoiser, true, tile_rows);
  };
  const Plate whole = shown(height, pixels.size() + 100 * width);
  render::Layers layers = layers_of(pixels, 4, render::plate_radiance(plate, response, 0.9));
  layers.width = width;
  layers.height = height;
  layers.white = 1 / 0.9;
  render::Denoiser denoiser(*shared_device());
  denoise(denoiser, layers, render::plate_radiance(plate, response, 0.9), {}, uncovered_of(pixels));
  expect_same_but_for_rounding(whole, reference(layers, plate, 8, 0.9));
  EXPECT_EQ(shown(height, 110 * width).samples, whole.samples);
  EXPECT_EQ(shown(32, 110 * width).samples, whole.samples);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

}  // namespace previz::test::show_test
