// The code from which on a camera clips, from brackets of cameras that clip at a known one.
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/sensor/clip_fit.hpp"
#include "tests/support/calibrate_pictures.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/shared_data.hpp"

namespace previz::calibrate::clip_test {

namespace fs = std::filesystem;

constexpr int width = 160, height = 48, exposures = 5;
constexpr double stops = 2;

// Returns the picture's value 0..1 of a signal, of which 1 is white, for a channel.
using Camera = std::function<double(double signal, int channel)>;

double hard(double signal, int) {
  return std::pow(std::min(signal, 1.0), 0.45);
}
double limited(double signal, int channel) {
  return (16 + 219 * hard(signal, channel)) / 255;
}
// A shoulder that comes to white smoothly: it rounds to code 254 from 5.1 on, to 255 from 6.3 on.
double soft(double signal, int) {
  return 1 - std::exp(-signal);
}
double blue_clips_first(double signal, int channel) {
  return channel == 2 ? std::min(hard(signal, channel), 240.0 / 255) : hard(signal, channel);
}

// From left to right the light rises by ten stops.
double light_at(int x) {
  return std::exp2(10.0 * x / width - 5);
}

double exposure_of(int e, double first) {
  return first * std::exp2(stops * e);
}

// `noise_codes` is the standard deviation that compression adds after clipping.
std::vector<BracketPicture> bracket_of(const Camera& camera, double first = 1.0 / 32,
                                       double noise_codes = 0) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 1);
  std::vector<BracketPicture> bracket;
  for (int e = 0; e < exposures; ++e) {
    BracketPicture picture{
        "picture " + std::to_string(e), exposure_of(e, first), width, height, {}};
    for (int p = 0; p < width * height; ++p)
      for (int c = 0; c < 3; ++c) {
        const double code = 255 * camera(light_at(p % width) * picture.exposure, c) +
                            (noise_codes > 0 ? noise_codes * noise(random) : 0);
        picture.rgb.push_back(std::uint8_t(std::clamp(std::floor(code + 0.5), 0.0, 255.0)));
      }
    bracket.push_back(std::move(picture));
  }
  return bracket;
}

// The curve that `previz calibrate response` would fit, here exactly; only codes below the middle
// one matter.
ResponseCurve curve_of(const Camera& camera) {
  std::vector<double> signal(256);
  for (std::size_t code = 1; code < 256; ++code) {
    double low = 0, high = 16;
    for (int i = 0; i < 60; ++i)
      (camera(0.5 * (low + high), 1) < double(code) / 255 ? low : high) = 0.5 * (low + high);
    signal[code] = high;
  }
  return monotone_curve(std::move(signal));
}

ClipFit fit_of(const Camera& camera, double first = 1.0 / 32, double noise_codes = 0) {
  return fit_clip(bracket_of(camera, first, noise_codes), curve_of(camera));
}

// Returns the code from which on pictures of so many bits count as clipped.
std::uint32_t counted_from(double share, int bits) {
  const ResponseCurve curve{
      .kind = ResponseCurve::Kind::linear, .inverse_table = {}, .clip_share = share};
  return lighting::Response(curve, bits).clipping().at;
}

TEST(ClipFit, FindsWhiteWhereverItIs) {
  EXPECT_EQ(fit_of(hard).code(), 255);
  EXPECT_EQ(fit_of(limited).code(), 235);
}

// A code survives the way into the set file, at any depth. The five digits lack at most 1e-5, which
// is less than one code of 16 bits.
TEST(ClipFit, TheShareStandsForTheCodeItself) {
  for (int code = 128; code < 256; ++code) {
    ClipFit fit;
    fit.channels[1] = {1000, code, code, 2};
    ASSERT_TRUE(fit.share());
    EXPECT_EQ(counted_from(*fit.share(), 8), std::uint32_t(code));
    EXPECT_EQ(counted_from(*fit.share(), 10), std::uint32_t(code) << 2);
    EXPECT_NEAR(counted_from(*fit.share(), 16), code << 8, 1);
  }
}

// One in twenty lies 1.645 standard deviations below the middle, whose standard error is, with
// thousands of samples, below a tenth of a deviation. Rounding moves it by half a code.
TEST(ClipFit, NoiseAfterClippingLowersItAsFarAsNineteenOfTwentyReach) {
  constexpr double deviation = 3;
  const ClipFit fit = fit_of(limited, 1.0 / 32, deviation);
  ASSERT_GT(fit.channels[1].samples, 1000u);
  ASSERT_TRUE(fit.code());
  EXPECT_NEAR(*fit.code(), 235 - 1.645 * deviation, 0.5 + 0.1 * deviation + 0.5);
  EXPECT_NEAR(fit.channels[1].usual, 235, 1);
}

// The codes of a shoulder are light. What lies a stop beyond 5.1, where the medians come within a
// code of white, is 255 exactly.
TEST(ClipFit, AShoulderIsLightAndNotWhite) {
  EXPECT_EQ(fit_of(soft).code(), 255);
}

TEST(ClipFit, TheLowestChannelDecidesAndEachIsNamed) {
  const ClipFit fit = fit_of(blue_clips_first);
  EXPECT_EQ(fit.channels[0].lowest, 255);
  EXPECT_EQ(fit.channels[2].lowest, 240);
  EXPECT_EQ(fit.code(), 240);
  EXPECT_THAT(describe(fit), HasSubstr("blue: from code 240"));
  EXPECT_THAT(describe(fit), HasSubstr("red: from code 255"));
}

// A third of what the longest exposure clips turns black in it: that moved, and is no clipped code.
TEST(ClipFit, WhatMovedIsNotClipped) {
  auto bracket = bracket_of(hard);
  for (int p = 0; p < width * height; ++p)
    if (p % width >= 105 && p % width < 120)
      for (std::size_t c = 0; c < 3; ++c) bracket.back().rgb[3 * std::size_t(p) + c] = 5;
  EXPECT_EQ(fit_clip(bracket, curve_of(hard)).code(), 255);
}

// The most light is 2^5, so that the longest exposure of 2^-6 shows it as half of white; and of
// 2^-4.5, which clips the brightest half stop, it shows nothing that is surely clipped.
TEST(ClipFit, WithoutClippedLightItSaysWhichPictureIsMissing) {
  for (const double longest : {-6.0, -4.5}) {
    const ClipFit fit = fit_of(hard, std::exp2(longest - stops * (exposures - 1)));
    EXPECT_FALSE(fit.code());
    EXPECT_FALSE(fit.share());
    EXPECT_THAT(describe(fit), HasSubstr("add a picture of two stops more exposure"));
  }
}

// Lamps of 24 by 24 pixels in the dark. Each has a rim of a pixel, in which demosaicing mixes three
// parts of a lamp's signal, clipped already, with seven of the dark: one in seven of its pixels, of
// code 148 at most. JPEG at quality 75 then spreads the codes on both sides. What is counted is
// checked by what each pixel truly got: of the pixels inside, away from the rims, nine in ten of
// the clipped ones (nineteen in twenty, less what ringing differs by from one exposure to another),
// and none of those that get half of white, whose code of 187 is farther from white than ringing
// reaches within an even area.
TEST(ClipFit, RingingAndMixedEdgesDoNotLowerItToLight) {
  constexpr int side = 192, cell = 48, lamp = 24;
  const auto lamp_light = [&](int x, int y) {
    const int number = x / cell + side / cell * (y / cell);
    return std::exp2(0.25 * number);
  };
  const auto weight = [&](int x, int y) {
    const auto inside = [](int a) {
      const int at = a % cell - (cell - lamp) / 2;
      return at == -1 || at == lamp ? 0.3 : at < 0 || at > lamp ? 0.002 : 1.0;
    };
    return std::min(inside(x), inside(y));
  };
  std::vector<BracketPicture> bracket;
  for (int e = 0; e < exposures; ++e) {
    BracketPicture picture{"jpeg", exposure_of(e, 1.0 / 64), side, side, {}};
    cv::Mat3b drawn(side, side);
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        drawn(y, x) = cv::Vec3b::all(std::uint8_t(std::floor(
            255 * hard(std::min(lamp_light(x, y) * picture.exposure, 1.0) * weight(x, y), 0) +
            0.5)));
    std::vector<std::uint8_t> file;
    cv::imencode(".jpg", drawn, file, {cv::IMWRITE_JPEG_QUALITY, 75});
    const cv::Mat3b read = cv::imdecode(file, cv::IMREAD_COLOR);
    for (const cv::Vec3b& bgr : read)
      for (const int c : {2, 1, 0}) picture.rgb.push_back(bgr[c]);
    bracket.push_back(std::move(picture));
  }
  const ClipFit fit = fit_clip(bracket, curve_of(hard));
  ASSERT_TRUE(fit.code());
  int clipped = 0, counted = 0, light = 0, light_counted = 0;
  for (const BracketPicture& picture : bracket)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        if (weight(x, y) < 1 || weight(x - 2, y) < 1 || weight(x + 2, y) < 1 ||
            weight(x, y - 2) < 1 || weight(x, y + 2) < 1)
          continue;
        const double signal = lamp_light(x, y) * picture.exposure;
        const bool is_counted = picture.rgb[3 * std::size_t(y * side + x) + 1] >= *fit.code();
        if (signal >= 2) ++clipped, counted += is_counted;
        if (signal <= 0.5) ++light, light_counted += is_counted;
      }
  std::printf("JPEG: code %d, %d of %d clipped, %d of %d below half of white\n", *fit.code(),
              counted, clipped, light_counted, light);
  EXPECT_GT(counted, 0.9 * clipped);
  EXPECT_EQ(light_counted, 0);
}

// The light camera of the pictures.
LightCameraCalibration light_camera() {
  LightCameraCalibration camera;
  camera.intrinsics = {width, height, 20, 20, 79.5, 23.5, {}, 1.5};
  return camera;
}

// The table of the command, in a set file: what is measured reaches what the renderer asks.
class ClipCommand : public testing::Test {
 protected:
  void write_pictures(const std::vector<BracketPicture>& bracket) const {
    std::ofstream list(folder() / "exposures.txt");
    for (std::size_t e = 0; e < bracket.size(); ++e) {
      cv::Mat3b bgr(height, width);
      for (int p = 0; p < width * height; ++p)
        for (int c = 0; c < 3; ++c)
          bgr(p / width, p % width)[2 - c] = bracket[e].rgb[3 * std::size_t(p) + std::size_t(c)];
      const std::string name = std::to_string(e) + ".png";
      cv::imwrite((folder() / name).string(), bgr);
      list << name << ' ' << bracket[e].exposure << '\n';
    }
  }
  // What the command prints about the pictures, or about a session.
  // Returns what the command says, and behind it the tables that it wrote.
  std::string printed(CameraRole role, const fs::path& session = {}) const {
    ResponseOptions options{.footage = session,
                            .camera = role,
                            .exposures = {},
                            .method = ResponseMethod::debevec,
                            .table_file = folder() / "table.toml"};
    if (session.empty()) {
      options.footage = folder();
      options.exposures = folder() / "exposures.txt";
    }
    std::ostringstream out;
    calibrate_response(options, out);
    return out.str() + table();
  }
  std::string table() const { return session::content_of(folder() / "table.toml"); }
  fs::path folder() const { return directory_.path(); }

  test::TemporaryDirectory directory_;
};

TEST_F(ClipCommand, WritesTheKeyUnderItsEvidence) {
  write_pictures(bracket_of(limited));
  EXPECT_THAT(printed(CameraRole::observer), HasSubstr("the camera clips from code 235 of 255 on"));
  EXPECT_THAT(table(), HasSubstr("clip_share = 0.91796\n"));
  EXPECT_THAT(table(), HasSubstr("# the camera clips from code 235"));
  EXPECT_EQ(counted_from(0.91796, 8), 235u);
}

TEST_F(ClipCommand, KeepsTheKeyWhereNothingClips) {
  write_pictures(bracket_of(hard, std::exp2(-6 - stops * (exposures - 1))));
  EXPECT_THAT(printed(CameraRole::observer), HasSubstr("keep the one that the set file has"));
  EXPECT_THAT(table(), Not(HasSubstr("clip_share")));
}

// The light camera's table is accepted by a set file, and with it what brackets are merged by.
TEST_F(ClipCommand, WritesTheLightCamerasKeyToo) {
  write_pictures(bracket_of(limited));
  const std::string output = printed(CameraRole::light);
  EXPECT_THAT(output, HasSubstr("the camera clips from code 235 of 255 on"));
  EXPECT_THAT(table(), HasSubstr("[light_camera.response]"));
  EXPECT_THAT(table(), HasSubstr("# the camera clips from code 235"));
  EXPECT_THAT(table(), Not(HasSubstr("DOUBT: the light camera clips")));
  const set::Set set = set::parse_set(
      set::intrinsics_toml(light_camera()) + set::light_pose_toml(glm::dmat4(1.0)) + table(),
      "printed.toml");
  ASSERT_TRUE(set.light_camera.calibration);
  EXPECT_EQ(set.light_camera.calibration->response.clip_share, 0.91796);
}

// A set file without the key means that its light camera clips nothing below white. So where a
// bracket shows nothing clipped, the table leaves the key out.
TEST_F(ClipCommand, LeavesTheLightCamerasKeyOutWhereNothingClips) {
  write_pictures(bracket_of(hard, std::exp2(-6 - stops * (exposures - 1))));
  const std::string output = printed(CameraRole::light);
  EXPECT_THAT(output, HasSubstr("the table has no clip_share"));
  EXPECT_THAT(table(), Not(HasSubstr("clip_share")));
}

// A session's own clip_share is compared with what its pictures show, and kept where they show
// nothing.
TEST_F(ClipCommand, ComparesWithWhatTheSessionSays) {
  const auto take = [&](const std::string& name, const std::string& source, const Camera& camera,
                        double first) {
    session::SessionInfo info;
    info.name = name;
    info.observer = ObserverCalibration{};
    info.observer->intrinsics = {width, height, 100, 100, 79.5, 23.5};
    info.observer->response.clip_share = 0.9;
    info.light = light_camera();
    test::record(folder() / name, info, source, bracket_of(camera, first));
    return folder() / name;
  };
  const std::string clips =
      printed(CameraRole::observer, take("clips", "observer", hard, 1.0 / 32));
  EXPECT_THAT(clips,
              HasSubstr("the session has clip_share = 0.9, which counts codes from 230 on: pixels "
                        "that still show light"));
  EXPECT_THAT(clips, HasSubstr("\nclip_share = 0.99609\n"));
  const std::string dark =
      printed(CameraRole::observer,
              take("dark", "observer", hard, std::exp2(-6 - stops * (exposures - 1))));
  EXPECT_THAT(dark, HasSubstr("clip_share stays 0.9\n"));
  EXPECT_THAT(dark, HasSubstr("\nclip_share = 0.9\n"));
  const std::string light = printed(CameraRole::light, take("light", "light", limited, 1.0 / 32));
  EXPECT_THAT(light,
              HasSubstr("the session has clip_share = 1, which counts codes from 255 on: pixels "
                        "below it are clipped but pass for measured light, so that lamps come out "
                        "too dark"));
  EXPECT_THAT(light, HasSubstr("\nclip_share = 0.91796\n"));
}

// A phone's JPEGs of a window clip at the largest codes.
TEST(RealClip, AWindowsBracketShowsWhereItClips) {
  const fs::path hdr = test::shared_data("real/hdr");
  PREVIZ_NEEDS(hdr);
  const auto window = read_bracket(hdr / "window", "", std::nullopt);
  const ClipFit fit = fit_clip(window, fit_response(window, ResponseMethod::debevec).curve);
  std::printf("window: %s", describe(fit).c_str());
  ASSERT_TRUE(fit.code());
  EXPECT_GE(*fit.code(), 250);
}

}  // namespace previz::calibrate::clip_test
