// Pictures from one pixel to the largest there are: they work, or are refused before anything is
// allocated.
#include "daemon/core/render/picture/picture_memory.hpp"

#include "tests/support/render_fixture.hpp"

namespace previz::test::picture_size_test {

constexpr std::uint64_t gib = 1ull << 30;

std::string words_of(const std::function<void()>& refusing) {
  return test::error_of([&] { refusing(); });
}

std::string refusal(int width, int height, const render::PictureMemory& memory) {
  return words_of([&] { render::refuse_too_large(width, height, memory); });
}

std::string refusal(int width, int height, int neighbours, const render::PictureMemory& memory,
                    std::uint64_t free_bytes, std::uint64_t take_frames = 1000) {
  return words_of([&] {
    render::refuse_too_many_neighbours(width, height, {neighbours, take_frames}, memory,
                                       free_bytes);
  });
}

// A white floor and a virtual box on it, in a white environment: whatever the size, the real floor
// shows 1, the box is there, and where it changes nothing the plate comes back.
void expect_shown(int width, int height) {
  SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height));
  View view = empty_view({0, -0.3, 1}, {0, 0, 0}, pinhole(width, height, 0.5), glm::vec3(1));
  add(view.scene, rectangle_mesh({100, 100}), diffuse(glm::vec3(1)));
  add(view.scene, box_mesh({0.4, 0.4, 0.1}), 0u, at({0, 0, 0.05}), scene::world_mixed);
  const double focal = 0.5 * std::max(width, height) / std::tan(0.25);
  view.calibration.intrinsics.fx = view.calibration.intrinsics.fy = focal;
  Plate plate{width, height, 8, {}};
  for (int i = 0; i < 3 * width * height; ++i)
    plate.samples.push_back(static_cast<std::uint16_t>(i % 256));

  set::Estimation estimation{.max_depth = 2};
  estimation.difference_sampling = 0;  // no chance in what the floor shows
  SetRenderer renderer(view, estimation, set::LightSampling::bsdf);
  renderer.begin({std::make_shared<const Plate>(plate), 1, view.world_from_camera});
  renderer.render(2);
  expect_clean(renderer.counters());
  const render::Layers layers = renderer.layers();
  ASSERT_EQ(layers.mixed.size(), static_cast<std::size_t>(width) * height);
  const Plate picture = renderer.show(false);
  ASSERT_EQ(renderer.show(true).samples.size(), plate.samples.size());
  ASSERT_EQ(picture.samples.size(), plate.samples.size());
  std::size_t covered = 0;
  for (std::size_t i = 0; i < layers.mixed.size(); ++i) {
    ASSERT_NEAR(layers.real[i].g, 1, 1e-5) << i;
    covered += layers.mask[i] > 0;
    if (layers.mask[i] == 0 && layers.diff[i] == glm::vec3(0)) {
      ASSERT_EQ(picture.samples[3 * i], plate.samples[3 * i]) << i;
    }
  }
  EXPECT_GT(covered, 0u);
}

TEST(PictureSize, OfOnePixelAndOfOddSides) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 17), std::pair(17, 1),
                                      std::pair(7, 5), std::pair(33, 9), std::pair(101, 67)})
    expect_shown(width, height);
}

// Rows as long as the largest camera's, and columns as high: bands of whole rows still fit.
TEST(PictureSize, OfEightThousandByAFew) {
  expect_shown(8192, 5);
  expect_shown(5, 4320);
}

// 8192x4320 is 35.4 million pixels of 185 bytes and a ray of 8, and 2.1 million of a band of 230:
// 7.31 GB.
TEST(PictureSize, Of8192x4320FitsOrIsRefused) {
  const std::uint64_t pixels = 1u << 27;
  EXPECT_EQ(refusal(8192, 4320, {.bytes = 8 * gib, .pixels = pixels}), "");
  const std::string no_memory = refusal(8192, 4320, {.bytes = 4 * gib, .pixels = pixels});
  EXPECT_THAT(no_memory, HasSubstr("8192x4320 takes 7.31 GB"));
  EXPECT_THAT(no_memory, HasSubstr("but there is only 4.29 GB"));
  // Made into layers in the same memory: 140 bytes more.
  const std::string shared =
      refusal(8192, 4320, {.bytes = 8 * gib, .pixels = pixels, .read_back = true});
  EXPECT_THAT(shared, HasSubstr("takes 12.3 GB"));
  const std::string no_pixels = refusal(8192, 4320, {.bytes = 64 * gib, .pixels = 1u << 16});
  EXPECT_THAT(no_pixels, HasSubstr("65536 pixels"));
}

// A megapixel that is averaged with two frames on each side takes 5 kept frames of 182 bytes a
// pixel and 5 layers of 80: 1.31 GB. A card has the picture in 193 bytes, 168 of history, and a
// band of 230: 0.591 GB. Without a card these, and 140 more, lie in the same memory: 2.04 GB.
TEST(PictureSize, ThatIsAveragedFitsOrIsRefused) {
  constexpr std::uint64_t megabyte = 1'000'000;
  const auto card = [](std::uint64_t megabytes) {
    return render::PictureMemory{.bytes = megabytes * megabyte, .pixels = 1u << 27};
  };
  EXPECT_EQ(refusal(1000, 1000, 2, card(610), 1320 * megabyte), "");
  EXPECT_EQ(refusal(1000, 1000, 2, card(610), 1300 * megabyte),
            "quality.neighbours = 2: to average 5 frames of 1000x1000 takes 1.31 GB of the "
            "computer's memory, and 1.3 GB are free; make the picture smaller (--scale), or "
            "average fewer (--neighbours 1 fits)");
  EXPECT_THAT(refusal(1000, 1000, 4, card(610), 300 * megabyte),
              HasSubstr("average fewer (--neighbours 0, every frame stands alone)"));
  EXPECT_EQ(refusal(1000, 1000, 1, card(580), 8 * gib),
            "quality.neighbours = 1: to average a picture of 1000x1000 takes 0.591 GB of the "
            "graphics card's memory, and there is 0.58 GB; make the picture smaller (--scale), or "
            "let every frame stand alone (--neighbours 0)");
  render::PictureMemory shared = card(8000);
  shared.read_back = true;
  EXPECT_EQ(refusal(1000, 1000, 2, shared, 2060 * megabyte), "");
  EXPECT_THAT(refusal(1000, 1000, 2, shared, 2020 * megabyte),
              HasSubstr("takes 2.04 GB of the computer's memory, and 2.02 GB are free"));
  EXPECT_THAT(refusal(1000, 1000, 2, card(100), 8 * gib), HasSubstr("takes 0.423 GB of memory"));
  // A take of three frames keeps no more than those, and as many layers: 0.786 GB.
  EXPECT_EQ(refusal(1000, 1000, 2, card(610), 790 * megabyte, 3), "");
  EXPECT_THAT(refusal(1000, 1000, 2, card(610), 780 * megabyte, 3),
              HasSubstr("to average 3 frames of 1000x1000 takes 0.786 GB"));
}

// More than any Vulkan device can address: refused at once, though a set file may ask for it.
TEST(PictureSize, OfMoreThanTheDeviceHoldsIsRefusedByTheRenderer) {
  for (const auto& [width, height] : {std::pair(65535, 65535), std::pair(0, 10)}) {
    const ObserverCalibration camera = pinhole(width, height, 0.5);
    EXPECT_THAT(words_of([&] { render::Renderer(shared_device(), {}, camera); }),
                HasSubstr(std::to_string(width) + "x"));
  }
}

// 16 parts are summed in a tree of five levels, each with 176 bytes a pixel.
TEST(PictureSize, WhosePartsHaveNoRoomIsRefused) {
  EXPECT_EQ(render::part_bytes(3840, 2160, 16), 5ull * 176 * 3840 * 2160);
  EXPECT_EQ(render::part_bytes(3840, 2160, 1), 0u);
  const std::string refusal =
      test::error_of([] { render::refuse_too_many_parts(3840, 2160, 16, 4'000'000'000); });
  EXPECT_THAT(refusal, HasSubstr("takes 7.3 GB of the computer's memory"));
  EXPECT_THAT(refusal, HasSubstr("4 GB are free; make the picture smaller (--scale)"));
  render::refuse_too_many_parts(3840, 2160, 16, 8'000'000'000);
}

}  // namespace previz::test::picture_size_test
