// A rendering that is smaller than the camera's picture is put onto the whole of it, which stays as
// sharp as the camera gave it.
#include "daemon/core/render/picture/enlarge.hpp"

#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::enlarge_test {

// A picture of random codes: what is not the camera's own would be seen anywhere.
FramePtr random_frame(int width, int height, PixelFormat format) {
  Frame frame;
  frame.width = width;
  frame.height = height;
  frame.format = format;
  frame.bytes.resize(frame_bytes(format, width, height));
  std::mt19937 random(11);
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(random());
  return std::make_shared<const Frame>(std::move(frame));
}

render::FrameInput input(FramePtr camera, const View& view, bool dithers = false) {
  return {.exposure = 0.5,
          .world_from_camera = view.world_from_camera,
          .dithers = dithers,
          .camera = std::move(camera),
          .is_scaled = true,
          .is_shown_whole = true};
}

// A matt floor to the left, on which a virtual ball's shadow lies; nothing to the right.
View ball_to_the_left(int width, int height) {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0}, pinhole(width, height, 0.8), glm::vec3(0.3f));
  add(view.scene, rectangle_mesh({0.5, 2}), diffuse(glm::vec3(0.5f)), at({-0.5, 0, 0}));
  add(view.scene, icosphere_mesh(0.15, 2), diffuse(glm::vec3(0.7f)), at({-0.4, 0, 0.2}),
      scene::world_mixed);
  return view;
}

struct Size {
  int width, height;
};

// Returns whether any of the rendering's pixels that a whole pixel lies between adds something.
bool is_touched(const render::Layers& layers, const Plate& small, const Plate& whole, int x, int y,
                const lighting::Response& response, double exposure) {
  const auto first = [](int at, int from, int to) {
    return std::clamp((at + 0.5) * from / to - 0.5, 0.0, from - 1.0);
  };
  const int left = static_cast<int>(first(x, small.width, whole.width));
  const int top = static_cast<int>(first(y, small.height, whole.height));
  for (int row = top; row <= std::min(top + 1, small.height - 1); ++row)
    for (int column = left; column <= std::min(left + 1, small.width - 1); ++column) {
      const auto pixel = static_cast<std::size_t>(row * small.width + column);
      if (layers.mask[pixel] != 0) return true;
      for (int c = 0; c < 3; ++c)
        if (layers.composite[pixel][c] !=
            static_cast<float>(response.inverse()[small.samples[3 * pixel + c]] / exposure))
          return true;
    }
  return false;
}

// A camera of 96x72 pixels, and a rendering of another size.
class Enlarged : public ::testing::TestWithParam<std::tuple<Size, PixelFormat>> {
 protected:
  const Size size_ = std::get<0>(GetParam());
  const View view_ = ball_to_the_left(size_.width, size_.height);
  SetRenderer renderer_{view_, {.max_depth = 3}};
  const FramePtr camera_ = random_frame(96, 72, std::get<1>(GetParam()));
  const Plate whole_ = to_plate(*camera_);
  const lighting::Response response_{{}, whole_.bits};
};
INSTANTIATE_TEST_SUITE_P(
    Sizes, Enlarged,
    ::testing::Combine(::testing::Values(Size{24, 18}, Size{23, 17}, Size{48, 36}, Size{95, 71}),
                       ::testing::Values(PixelFormat::rgb8, PixelFormat::rgb16)));

TEST_P(Enlarged, IsThePlateBitForBitWhereNothingVirtualTouchesIt) {
  for (const bool denoise : {false, true})
    for (const bool dithers : {false, true}) {
      renderer_.begin(input(camera_, view_, dithers));
      renderer_.render(4);
      const render::Layers layers = renderer_.layers();
      const Plate small = renderer_.plate();
      ASSERT_EQ(small.width, size_.width);
      const Plate shown = renderer_.show(denoise);
      expect_clean(renderer_.counters());
      ASSERT_EQ(shown.width, 96);
      ASSERT_EQ(shown.height, 72);
      ASSERT_EQ(shown.samples.size(), whole_.samples.size());
      int untouched = 0, changed = 0;
      for (int y = 0; y < 72; ++y)
        for (int x = 0; x < 96; ++x) {
          const auto at = static_cast<std::size_t>(3 * (y * 96 + x));
          const bool is_same =
              std::equal(&shown.samples[at], &shown.samples[at] + 3, &whole_.samples[at]);
          changed += is_same ? 0 : 1;
          // Filtering carries light on to pixels nearby.
          const bool is_far = x >= 72;
          if (denoise ? !is_far : is_touched(layers, small, whole_, x, y, response_, 0.5)) continue;
          ++untouched;
          EXPECT_TRUE(is_same) << x << ", " << y;
        }
      EXPECT_GE(untouched, 96 * 72 / 4);
      EXPECT_GT(changed, 96 * 72 / 50);
    }
}

// The device has the light in halves, whose last bit is 2^-11 of it, and light is up to twice white
// here; a response is at most 13 times as steep as from black to white (sRGB near black).
TEST_P(Enlarged, IsThatOfTheLayersInDoublePrecision) {
  renderer_.begin(input(camera_, view_));
  renderer_.render(16);
  const render::Layers layers = renderer_.layers();
  const auto signal_of = [&](std::uint16_t sample) {
    return static_cast<float>(response_.inverse()[sample]);
  };
  const auto expected =
      render::enlarged(render::additions_of(layers, renderer_.plate(), signal_of, 0.5),
                       renderer_.plate(), whole_, signal_of);
  const Plate shown = renderer_.show(false);
  const double most = (1 << whole_.bits) - 1;
  for (std::size_t i = 0; i < shown.samples.size(); ++i)
    EXPECT_NEAR(shown.samples[i], response_.forward(expected[i / 3][static_cast<int>(i % 3)]),
                1 + 2 * 0x1p-11 * 13 * most)
        << i;
}

// A virtual board of one colour, whose edge is upright and lies between two of the rendering's
// pixels, before a plate of random codes: none of them shows through it, and it ends as sharply as
// the plate could show.
TEST(EnlargedObject, HidesThePlateAndHasASharpOutline) {
  View view = empty_view({0, 0, 1}, {0, 1e-6, 0}, pinhole(24, 18, 0.8), glm::vec3(0.3f));
  scene::Material lamp = diffuse(glm::vec3(0));
  lamp.emission = glm::vec3(0.8f);
  add(view.scene, rectangle_mesh({2, 4}), lamp, at({-1, 0, 0}), scene::world_mixed);
  SetRenderer renderer(view, {.max_depth = 1});
  const FramePtr camera = random_frame(96, 72, PixelFormat::rgb8);
  const Plate whole = to_plate(*camera);
  renderer.begin(input(camera, view));
  renderer.render(16);
  const Plate shown = renderer.show(false);
  const std::uint16_t board = lighting::Response({}, 8).forward(0.4);
  int between = 0;
  for (int y = 0; y < 72; ++y)
    for (int x = 0; x < 96; ++x)
      for (int c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(3 * (y * 96 + x) + c);
        if (std::abs(x + 0.5 - 48) > 2) {
          EXPECT_EQ(shown.samples[at], x < 48 ? board : whole.samples[at]) << x << ", " << y;
        } else {
          between += shown.samples[at] != board && shown.samples[at] != whole.samples[at] ? 1 : 0;
        }
      }
  EXPECT_LE(between, 3 * 72 * 2);
}

// The two ways in which a picture comes down, and a picture of several bands.
TEST(EnlargedPicture, IsTheSameHoweverItIsAskedFor) {
  const View view = ball_to_the_left(24, 18);
  SetRenderer renderer(view, {.max_depth = 2});
  const FramePtr camera = random_frame(2300, 1725, PixelFormat::rgb8);
  renderer.begin(input(camera, view, true));
  renderer.render(2);
  const Plate shown = renderer.show(true);
  const render::Showing::Shown later = renderer.show_later(true).finish();
  EXPECT_EQ(shown.width, 2300);
  EXPECT_TRUE(later.picture->samples == shown.samples);
  render::Layers layers = renderer.layers();
  EXPECT_TRUE(renderer.show(true, &layers).samples == shown.samples);
  EXPECT_EQ(layers.width, 24);
  const Plate whole = to_plate(*camera);
  const std::size_t last = whole.samples.size() - 3;  // the last pixel of the last band
  EXPECT_TRUE(std::equal(&whole.samples[last], &whole.samples[last] + 3, &shown.samples[last]));
}

}  // namespace previz::test::enlarge_test
