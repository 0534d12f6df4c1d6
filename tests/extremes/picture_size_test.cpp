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
  // Made into layers in the same memory: 80 bytes more. In scratch files: neither these nor the
  // sums, which are 176.
  const std::string shared =
      refusal(8192, 4320, {.bytes = 8 * gib, .pixels = pixels, .read_back = true});
  EXPECT_THAT(shared, HasSubstr("takes 10.1 GB"));
  EXPECT_EQ(refusal(8192, 4320,
                    {.bytes = 2 * gib, .pixels = pixels, .read_back = true, .in_scratch = true}),
            "");
  const std::string no_pixels = refusal(8192, 4320, {.bytes = 64 * gib, .pixels = 1u << 16});
  EXPECT_THAT(no_pixels, HasSubstr("65536 pixels"));
}

render::TakeOfPictures megapixels(int each_side, std::uint64_t take_frames = 1000, int parts = 1) {
  return {1000, 1000, each_side, take_frames, parts};
}

// A megapixel that is averaged with two frames on each side takes 5 kept frames of 176 bytes a
// pixel and 4 layers of 80, and 12 as they are written; its sums in 16 parts 5 times 176. Without a
// card there are the sums, too, and 168 bytes of history.
TEST(PictureSize, OfATakeIsCountedByWhatCanLieInFiles) {
  constexpr std::uint64_t pixels = 1'000'000;
  const render::PictureMemory card, shared{.read_back = true};
  const auto banded = [](const render::TakeOfPictures& take, const render::PictureMemory& device) {
    return render::take_memory(take, device).banded;
  };
  EXPECT_EQ(banded(megapixels(2), card), pixels * (5 * 176 + 4 * 80 + 12));
  EXPECT_EQ(banded(megapixels(2, 3), card), pixels * (3 * 176 + 3 * 80 + 12));
  EXPECT_EQ(banded(megapixels(0), card), pixels * (3 * 80 + 12));
  EXPECT_EQ(banded(megapixels(0, 1, 16), card), pixels * (80 + 12 + 5 * 176));
  EXPECT_EQ(banded(megapixels(2), shared), pixels * (5 * 176 + 4 * 80 + 12 + 176 + 168));
}

// With 400 MB for the program, and what has to be in memory: 99 bytes a pixel of frames, 17 of
// plate and rays, and 230 of a band.
TEST(PictureSize, ThatIsMoreThanAskedForLiesInFilesOrIsRefused) {
  const render::PictureMemory shared{.read_back = true};
  const auto plan = [&](std::optional<std::uint64_t> asked, std::uint64_t free_bytes = 64 * gib) {
    return render::plan_memory(megapixels(2), shared, asked, free_bytes);
  };
  const render::TakeMemory needed = render::take_memory(megapixels(2), shared);
  EXPECT_NEAR(static_cast<double>(needed.rest), 746e6, 1e6);
  EXPECT_FALSE(plan(needed.whole()).in_scratch);
  EXPECT_FALSE(plan({}).in_scratch);
  const render::MemoryPlan less = plan(1'200'000'000);
  EXPECT_TRUE(less.in_scratch);
  EXPECT_EQ(less.resident, 1'200'000'000 - needed.rest);
  EXPECT_EQ(plan(needed.whole() - 1).resident, 512'000'000u);
  // Nine tenths of what is free may be taken, whatever was asked for.
  EXPECT_TRUE(plan({}, 2'000'000'000).in_scratch);
  EXPECT_TRUE(plan(8 * gib, 2'000'000'000).in_scratch);
  EXPECT_EQ(words_of([&] { plan(800'000'000); }),
            "pictures of 1000x1000 take at least 0.874 GB of the computer's memory, and 0.8 GB are "
            "allowed; make the pictures smaller (--scale), or allow more (--memory)");
  EXPECT_THAT(
      words_of([&] { plan(8 * gib, 900'000'000); }),
      HasSubstr("and 0.81 GB are free; make the pictures smaller (--scale), or close other"));
}

// Nobody asked: what is more than 4 GB lies in files, however much is free.
TEST(PictureSize, Of3840x2160LiesInFilesUnlessMoreIsAskedFor) {
  const render::TakeOfPictures take{3840, 2160, 2, 1000, 1};
  const render::PictureMemory shared{.read_back = true};
  EXPECT_TRUE(render::plan_memory(take, shared, {}, 64 * gib).in_scratch);
  EXPECT_FALSE(render::plan_memory(take, shared, 16 * gib, 64 * gib).in_scratch);
}

// A card has the picture in 193 bytes a pixel, 168 of history, and a band of 230: 0.591 GB.
TEST(PictureSize, WhoseHistoryACardHasNoRoomForIsRefused) {
  const auto refused = [](int each_side, std::uint64_t megabytes) {
    return words_of([&] {
      render::refuse_too_large(megapixels(each_side),
                               {.bytes = megabytes * 1'000'000, .pixels = 1u << 27});
    });
  };
  EXPECT_EQ(refused(1, 610), "");
  EXPECT_EQ(refused(0, 580), "");
  EXPECT_EQ(refused(1, 580),
            "quality.neighbours = 1: to average a picture of 1000x1000 takes 0.591 GB of the "
            "graphics card's memory, and there is 0.58 GB; make the pictures smaller (--scale), or "
            "let every frame stand alone (--neighbours 0)");
  EXPECT_THAT(refused(2, 100), HasSubstr("takes 0.423 GB of memory"));
}

// More than any Vulkan device can address: refused at once, though a set file may ask for it.
TEST(PictureSize, OfMoreThanTheDeviceHoldsIsRefusedByTheRenderer) {
  for (const auto& [width, height] : {std::pair(65535, 65535), std::pair(0, 10)}) {
    const ObserverCalibration camera = pinhole(width, height, 0.5);
    EXPECT_THAT(words_of([&] { render::Renderer(shared_device(), {}, camera); }),
                HasSubstr(std::to_string(width) + "x"));
  }
}

}  // namespace previz::test::picture_size_test
