// A device makes the plate's codes of the camera's bytes as the computer does, bit for bit, and
// pictures are those of the plate.
#include "daemon/core/render/passes/device_plate.hpp"

#include "daemon/core/render/device/device.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::device_plate_test {

struct Kind {
  PixelFormat format;
  BayerPattern bayer = BayerPattern::none;
};
constexpr Kind kinds[] = {
    {PixelFormat::rgb8},
    {PixelFormat::rgb16},
    {PixelFormat::gray8},
    {PixelFormat::gray16},
    {PixelFormat::yuv422p8},
    {PixelFormat::gray8, BayerPattern::rggb},
    {PixelFormat::gray8, BayerPattern::grbg},
    {PixelFormat::gray8, BayerPattern::gbrg},
    {PixelFormat::gray8, BayerPattern::bggr},
    {PixelFormat::gray16, BayerPattern::rggb},
    {PixelFormat::gray16, BayerPattern::bggr},
};

std::string name_of(const Kind& kind) {
  return std::string(to_string(kind.format)) + " " + to_string(kind.bayer);
}

Frame random_frame(const Kind& kind, int width, int height) {
  Frame frame;
  frame.format = kind.format;
  frame.bayer = kind.bayer;
  frame.width = width;
  frame.height = height;
  std::mt19937 random(width);
  frame.bytes.resize(frame_bytes(kind.format, width, height));
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(random());
  return frame;
}

class DevicePlates : public ::testing::TestWithParam<bool> {  // as a graphics card?
 protected:
  DevicePlates()
      : device_(render::open_device({.validation = true, .name = "", .as_gpu = GetParam()})) {}

  std::vector<std::uint16_t> codes_of(render::DevicePlate& plate, std::size_t count) {
    return render::download<std::uint16_t>(*device_, plate.codes(), count);
  }
  std::shared_ptr<render::Device> device_;
};

TEST_P(DevicePlates, HaveTheCodesOfTheComputer) {
  for (const Kind& kind : kinds) {
    render::DevicePlate plate(*device_);
    for (const auto& [width, height] : {std::pair{2, 2}, {3, 5}, {17, 12}, {640, 480}, {5, 3}}) {
      const Frame frame = random_frame(kind, width, height);
      plate.take(frame);
      const std::vector<std::uint16_t> expected = to_plate(frame).samples;
      ASSERT_EQ(codes_of(plate, expected.size()), expected)
          << name_of(kind) << " " << width << "x" << height;
    }
  }
  EXPECT_EQ(render::validation_messages(*device_), 0u);
}

// Every luma meets every step of chroma at both ends of either range and in its middle.
TEST_P(DevicePlates, HaveTheCodesOfEveryLuma) {
  constexpr int chroma[] = {0, 1, 16, 90, 127, 128, 129, 200, 240, 254, 255};
  const int width = 512, height = static_cast<int>(std::size(chroma) * std::size(chroma));
  Frame frame = random_frame({PixelFormat::yuv422p8}, width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      frame.bytes[y * width + x] = static_cast<std::uint8_t>(x / 2);
      const int at = y * width / 2 + x / 2;
      frame.bytes[width * height + at] = static_cast<std::uint8_t>(chroma[y % std::size(chroma)]);
      frame.bytes[width * height * 3 / 2 + at] =
          static_cast<std::uint8_t>(chroma[y / std::size(chroma)]);
    }
  render::DevicePlate plate(*device_);
  plate.take(frame);
  const std::vector<std::uint16_t> expected = to_plate(frame).samples;
  EXPECT_EQ(codes_of(plate, expected.size()), expected);
}

TEST_P(DevicePlates, RefuseAFrameThatIsCutShort) {
  Frame frame = random_frame({PixelFormat::rgb8}, 8, 8);
  frame.bytes.pop_back();
  render::DevicePlate plate(*device_);
  EXPECT_THAT(error_of([&] { plate.take(frame); }), HasSubstr("holds 191 bytes"));
}

INSTANTIATE_TEST_SUITE_P(Memory, DevicePlates, ::testing::Bool(),
                         [](const auto& mode) { return mode.param ? "AsAGpu" : "AsACpu"; });

// Returns the mean of the linear signal over the area of a pixel of a smaller picture.
double mean_signal(const Plate& whole, const lighting::Response& response, int width, int height,
                   int column, int row, int channel) {
  const double across = double(whole.width) / width, down = double(whole.height) / height;
  const auto share = [](int pixel, int index, double side) {
    return std::max(std::min(pixel + 1.0, (index + 1) * side) - std::max(1.0 * pixel, index * side),
                    0.0);
  };
  double sum = 0;
  for (int y = 0; y < whole.height; ++y)
    for (int x = 0; x < whole.width; ++x)
      sum += share(x, column, across) * share(y, row, down) *
             response.inverse()[whole.samples[3 * (y * whole.width + x) + channel]];
  return sum / (across * down);
}

// Every code of a smaller plate is the one that its mean becomes, or the next one where the mean
// lies at the very edge between two: single precision is off by at most four roundings, 2^-22.
TEST_P(DevicePlates, OfSmallerPicturesHaveTheMeans) {
  for (const Kind& kind : {kinds[0], kinds[1], kinds[5], kinds[9]}) {
    const Frame frame = random_frame(kind, 32, 24);
    const Plate whole = to_plate(frame);
    for (const auto curve : {ResponseCurve::Kind::linear, ResponseCurve::Kind::srgb}) {
      const lighting::Response response({.kind = curve, .inverse_table = {}}, whole.bits);
      const render::CodeTables tables(*device_, response);
      for (const auto& [width, height] : {std::pair{24, 18}, {16, 12}, {11, 9}, {32, 24}, {1, 1}}) {
        render::DevicePlate plate(*device_);
        plate.take(frame, width, height, tables);
        const std::vector<std::uint16_t> codes =
            codes_of(plate, static_cast<std::size_t>(3 * width * height));
        for (int i = 0; i < 3 * width * height; ++i) {
          const double mean =
              mean_signal(whole, response, width, height, i / 3 % width, i / 3 / width, i % 3);
          const auto code_of = [&](double off) { return response.forward(mean + off); };
          ASSERT_GE(codes[i], code_of(-0x1p-22)) << name_of(kind) << " " << width << ", " << i;
          ASSERT_LE(codes[i], code_of(0x1p-22)) << name_of(kind) << " " << width << ", " << i;
        }
      }
    }
  }
}

// A frame may have a code from `least` on exactly where its plate has one; one of Y'CbCr at least
// there.
TEST(DevicePlate, KnowsWhetherAFrameMayClip) {
  for (const Kind& kind : kinds) {
    for (int seed = 2; seed < 12; ++seed) {
      const Frame frame = random_frame(kind, seed, 2);
      const Plate plate = to_plate(frame);
      const std::uint32_t most = std::ranges::max(plate.samples);
      for (const std::uint32_t least : {most / 2, most, most + 1}) {
        const bool expected = render::has_at_least(plate, least);
        EXPECT_EQ(expected, least <= most);
        const bool is_bound = kind.format == PixelFormat::yuv422p8;
        EXPECT_TRUE(render::has_at_least(frame, least) == expected || (is_bound && !expected))
            << name_of(kind);
      }
    }
  }
}

TEST(DevicePlate, OfDarkLumaAndGreyChromaDoesNotClip) {
  Frame frame = random_frame({PixelFormat::yuv422p8}, 8, 8);
  std::ranges::fill(frame.bytes, std::uint8_t{128});
  EXPECT_FALSE(render::has_at_least(frame, 255));
}

// Two levels of luma far below white, and chroma of a little more than grey.
TEST(DevicePlate, OfModestColoursDoesNotClip) {
  Frame frame = random_frame({PixelFormat::yuv422p8}, 130, 9);
  for (std::size_t i = 0; i < frame.bytes.size(); ++i)
    frame.bytes[i] = static_cast<std::uint8_t>(i < 130 * 9 ? 60 + frame.bytes[i] % 100
                                                           : 120 + frame.bytes[i] % 16);
  EXPECT_LT(std::ranges::max(to_plate(frame).samples), 240);
  EXPECT_FALSE(render::has_at_least(frame, 240));
  frame.bytes[130 * 9 - 1] = 255;
  EXPECT_TRUE(render::has_at_least(frame, 240));
}

TEST(DevicePlate, IsNotMadeLarger) {
  const View view = empty_view({0, -0.8, 1}, {0, 0, 0}, pinhole(8, 8, 0.8), glm::vec3(0.3f));
  SetRenderer renderer(view, {.max_depth = 1});
  const auto begin = [&](int width, int height) {
    renderer.begin(
        {.camera = std::make_shared<const Frame>(random_frame({PixelFormat::rgb8}, width, height)),
         .is_scaled = true});
  };
  EXPECT_THAT(error_of([&] { begin(16, 7); }), HasSubstr("16x7 does not fit"));
  EXPECT_NO_THROW(begin(16, 9));
}

TEST(DevicePlate, IsNotMadeOfAFrameThatIsCutShort) {
  const View view = empty_view({0, -0.8, 1}, {0, 0, 0}, pinhole(8, 8, 0.8), glm::vec3(0.3f));
  SetRenderer renderer(view, {.max_depth = 1});
  for (const std::size_t left : {0u, 63u, 64u, 127u}) {
    Frame frame = random_frame({PixelFormat::yuv422p8}, 8, 8);
    frame.bytes.resize(left);
    EXPECT_THAT(error_of([&] { renderer.begin({.camera = std::make_shared<const Frame>(frame)}); }),
                HasSubstr("holds " + std::to_string(left) + " bytes"));
  }
}

// The picture, and its layers, are those of the plate: also where the plate is a measurement.
class PictureOfACameraFrame : public ::testing::TestWithParam<std::tuple<set::RealRadiance, bool>> {
};

TEST_P(PictureOfACameraFrame, IsThatOfItsPlate) {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(64, 48, 0.8), glm::vec3(0.3f));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
  add(view.scene, icosphere_mesh(0.2, 1), diffuse(glm::vec3(0.7f)), at({0, 0, 0.25}),
      scene::world_mixed);
  set::Estimation estimation{.max_depth = 2};
  estimation.real_radiance = std::get<0>(GetParam());
  SetRenderer renderer(view, estimation, set::LightSampling::importance,
                       std::get<1>(GetParam())
                           ? render::open_device({.validation = true, .name = "", .as_gpu = true})
                           : shared_device());
  for (const Kind& kind : kinds) {
    const auto frame = std::make_shared<const Frame>(random_frame(kind, 64, 48));
    const auto picture = [&](PlatePtr plate, FramePtr camera) {
      renderer.begin({.plate = std::move(plate),
                      .exposure = 0.5,
                      .world_from_camera = view.world_from_camera,
                      .camera = std::move(camera)});
      renderer.render(2);
      const render::Layers layers = renderer.layers();
      return std::pair(renderer.show(true).samples, layers.composite);
    };
    const auto expected = picture(std::make_shared<const Plate>(to_plate(*frame)), nullptr);
    EXPECT_EQ(picture(nullptr, frame), expected) << name_of(kind);
  }
}

INSTANTIATE_TEST_SUITE_P(Real, PictureOfACameraFrame,
                         ::testing::Combine(::testing::Values(set::RealRadiance::traced,
                                                              set::RealRadiance::camera),
                                            ::testing::Bool()),
                         [](const auto& kind) {
                           return std::string(std::get<0>(kind.param) == set::RealRadiance::camera
                                                  ? "Camera"
                                                  : "Traced") +
                                  (std::get<1>(kind.param) ? "AsAGpu" : "AsACpu");
                         });

}  // namespace previz::test::device_plate_test
