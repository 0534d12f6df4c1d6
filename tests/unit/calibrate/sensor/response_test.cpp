// Response curves from brackets whose curve is known, and from the real ones.
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/sensor/brackets.hpp"
#include "daemon/tools/calibrate/sensor/response_fit.hpp"
#include "tests/support/calibrate_pictures.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::calibrate::response_test {

namespace fs = std::filesystem;

constexpr int width = 60, height = 50;

// An S in the logarithm, as cameras with a "look" have it.
double camera_value(double signal) {
  const double s = std::min(signal, 1.0);
  return std::pow(s, 0.45) * (1 + 0.25 * std::sin(3 * s)) / (1 + 0.25 * std::sin(3.0));
}

// Radiance over 10 stops, a white balance that differs by channel, sensor noise in the signal.
std::vector<BracketPicture> make_bracket(int pictures, double stops, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  const double balance[] = {1.6, 1, 0.7};
  std::vector<BracketPicture> bracket;
  for (int e = 0; e < pictures; ++e) {
    BracketPicture picture{
        "picture " + std::to_string(e), std::exp2(stops * e) / 64, width, height, {}};
    for (int p = 0; p < width * height; ++p)
      for (const double channel : balance) {
        const double radiance = std::exp2(10.0 * (p % 997) / 997 - 5) * channel;
        const double signal = radiance * picture.exposure;
        const double seen = signal + std::sqrt(signal / 30000 + 9e-8) * noise(random);
        picture.rgb.push_back(
            std::uint8_t(std::floor(255 * camera_value(std::max(seen, 0.0)) + 0.5)));
      }
    bracket.push_back(std::move(picture));
  }
  return bracket;
}

class ResponseMethods : public testing::TestWithParam<ResponseMethod> {};

// The signal that the camera shows as this value.
double true_signal(double value) {
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i)
    (camera_value(0.5 * (low + high)) < value ? low : high) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

// The squared error of a curve in codes, over those that are neither black nor white. A curve is
// known up to its scale.
double squared_error_codes(const ResponseCurve& curve) {
  const lighting::Response found(curve, 8);
  std::vector<double> ratios;
  for (int code = 30; code <= 220; ++code)
    ratios.push_back(std::log(found.inverse()[std::size_t(code)] / true_signal(code / 255.0)));
  std::vector<double> sorted = ratios;
  std::ranges::nth_element(sorted, sorted.begin() + 95);
  const double scale = sorted[95];
  double squares = 0;
  for (std::size_t i = 0; i < ratios.size(); ++i) {
    const double value = (30.0 + double(i)) / 255, step = 1.0 / 255;
    const double slope = 0.5 * std::log(true_signal(value + step) / true_signal(value - step));
    squares += std::pow((ratios[i] - scale) / slope, 2);
  }
  return squares / double(ratios.size());
}

// The bounds are stated ones, of the mean over several brackets, since the noise of a single one
// moves Debevec's curve by 0.3 to 2.5 codes. In the middle of the scale a code is 1 / (0.45 * 128 *
// ln 2) = 0.025 stops, so that 2 codes are a twentieth of a stop: half of what a camera's exposures
// are known to. Robertson's method finds each code by itself and keeps the noise of the few pixels
// that show it, for which it is allowed half as much again.
//
// What a left-out exposure is missed by follows from that. A code has the noise of its rounding,
// sqrt(1/12), and of the sensor, about 0.75 in the middle (sqrt(0.2 / 30000) times the slope of 290
// codes); seen and predicted have it both, and the curve's error comes on top. The median of a
// normal deviate's magnitude is 0.6745 of its deviation. Errors are whole codes, and at 2 the
// nearest one would be wrong.
TEST_P(ResponseMethods, FindTheCurve) {
  constexpr unsigned brackets = 4;
  double squares = 0, left_out = 0;
  for (unsigned seed = 1; seed <= brackets; ++seed) {
    const ResponseFit fit = fit_response(make_bracket(6, 1.6, seed), GetParam());
    squares += squared_error_codes(fit.curve) / brackets;
    left_out += fit.error_codes / brackets;
  }
  const double bound = GetParam() == ResponseMethod::debevec ? 2 : 3;
  EXPECT_LT(std::sqrt(squares), bound);
  const double code_variance = 1.0 / 12 + 0.75 * 0.75;
  EXPECT_LT(left_out, std::min(2.0, 0.6745 * std::sqrt(2 * code_variance + bound * bound)));
}

INSTANTIATE_TEST_SUITE_P(Response, ResponseMethods,
                         testing::Values(ResponseMethod::debevec, ResponseMethod::robertson),
                         [](const auto& method) { return std::string(to_string(method.param)); });

// An exposure that was not what it says: the prediction of the others shows it. A stop is 40 codes
// in the middle of the scale and 0.45 ln 2 of a code's value everywhere: at least 15 from code 48
// on, which is below the median of what is predicted.
TEST(ResponseFit, AWrongExposureStandsOut) {
  auto bracket = make_bracket(5, 2);
  bracket[3].exposure *= 2;
  const ResponseFit fit = fit_response(bracket, ResponseMethod::debevec);
  EXPECT_GT(fit.left_out[3].error_codes[1], 15);
}

TEST(ResponseFit, WhatMovedIsNotTaken) {
  auto bracket = make_bracket(7, 1.5);
  std::ranges::fill(bracket[6].rgb, std::uint8_t{0});
  const std::string refusal =
      test::error_of([&] { fit_response(bracket, ResponseMethod::debevec); });
  EXPECT_THAT(refusal, HasSubstr("brighten with exposure"));
}

TEST(ResponseFit, WritesTheTableThatASetFileTakes) {
  LightCameraCalibration camera;
  camera.response = fit_response(make_bracket(4, 2), ResponseMethod::debevec).curve;
  camera.intrinsics = {512, 512, 145, 145, 255.5, 255.5, {}, 1.5};
  const set::Set set =
      set::parse_set(set::intrinsics_toml(camera) + set::light_pose_toml(glm::dmat4(1.0)) +
                         set::response_toml(camera),
                     "printed.toml");
  ASSERT_TRUE(set.light_camera.calibration);
  const ResponseCurve& read = set.light_camera.calibration->response;
  EXPECT_EQ(read.kind, ResponseCurve::Kind::table);
  ASSERT_EQ(read.inverse_table.size(), 256u);
  for (std::size_t v = 0; v < 256; ++v)
    EXPECT_NEAR(read.inverse_table[v], camera.response.inverse_table[v],
                1e-11 * camera.response.inverse_table[v]);
  EXPECT_NO_THROW(lighting::Response(read, 8));
}

TEST(ResponseCurveFit, MonotoneCurvesStrictlyIncrease) {
  std::vector<double> signal(256);
  for (std::size_t v = 0; v < 256; ++v) signal[v] = double(v) + 20 * std::sin(0.3 * double(v));
  const ResponseCurve curve = monotone_curve(signal);
  EXPECT_EQ(curve.inverse_table.front(), 0);
  EXPECT_EQ(curve.inverse_table.back(), 1);
  EXPECT_NO_THROW(lighting::Response(curve, 8));  // every code comes back as itself
  // What increases already is only scaled.
  for (std::size_t v = 0; v < 256; ++v) signal[v] = double(v * v);
  const ResponseCurve square = monotone_curve(signal);
  EXPECT_NEAR(square.inverse_table[100], 100.0 * 100 / (255.0 * 255), 1e-12);
}

class BracketFiles : public testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i < 3; ++i)
      cv::imwrite((folder() / (std::string(1, char('a' + i)) + ".png")).string(),
                  cv::Mat3b(4, 4, cv::Vec3b(3, 2, std::uint8_t(40 * (i + 1)))));
  }
  fs::path folder() const { return directory_.path(); }
  fs::path list(const std::string& text) const {
    std::ofstream(folder() / "exposures.txt") << text;
    return folder() / "exposures.txt";
  }
  std::string problem(const std::string& text) const {
    return test::error_of([&] { read_bracket(folder(), "", list(text)); });
  }
  test::TemporaryDirectory directory_;
};

TEST_F(BracketFiles, ComeDarkestFirst) {
  const auto bracket = read_bracket(
      folder(), "", list("# name seconds\na.png 2 as measured\nb.png 1/4\nc.png 0.5\n"));
  ASSERT_EQ(bracket.size(), 3u);
  EXPECT_EQ(bracket[0].exposure, 0.25);
  EXPECT_EQ(bracket[2].exposure, 2);
  EXPECT_EQ(bracket[0].rgb[0], 80);  // red of b.png
  EXPECT_EQ(bracket[0].rgb[2], 3);
}

// A curve's code c is 257 c of 16 bits, as lighting::Response reads them: the nearest one is off by
// at most half a code.
TEST_F(BracketFiles, Of16BitsAreTheNearestCodes) {
  cv::Mat3w every(256, 256);
  for (int i = 0; i < 65536; ++i) {
    const auto sample = std::uint16_t(i);
    every(i / 256, i % 256) = {sample, sample, sample};
  }
  for (const char* name : {"a.png", "b.png", "c.png"})
    cv::imwrite((folder() / name).string(), every);
  const auto bracket = read_bracket(folder(), "", list("a.png 1\nb.png 2\nc.png 4\n"));
  ASSERT_EQ(bracket[0].rgb.size(), 3u * 65536);
  double most = 0;
  for (std::size_t i = 0; i < 65536; ++i)
    most = std::max(most, std::abs(bracket[0].rgb[3 * i] - double(i) / 257));
  EXPECT_LE(most, 0.5);
}

TEST_F(BracketFiles, EveryMistakeIsNamed) {
  EXPECT_THAT(problem("a.png 1\nb.png 2\n"), HasSubstr("no line for c.png"));
  EXPECT_THAT(problem("a.png 1\nb.png two\n"), HasSubstr(":2: \"two\" is not an exposure"));
  EXPECT_THAT(problem("a.png 1\nb.png 2\nc.png 2.001\n"), HasSubstr("the same exposure as"));
  const std::string without_list =
      test::error_of([&] { read_bracket(folder(), "", std::nullopt); });
  EXPECT_THAT(without_list, HasSubstr("has no EXIF exposure time"));
}

TEST_F(BracketFiles, OfASessionAreItsExposures) {
  const fs::path session = folder() / "take";
  std::vector<BracketPicture> pictures;
  for (int i = 0; i < 6; ++i)
    pictures.push_back({"", 0.01 * std::exp2(i % 3), 8, 8,
                        std::vector<std::uint8_t>(3 * 64, std::uint8_t(50 * (i % 3)))});
  session::SessionInfo info;
  info.name = "bracket";
  test::record(session, info, "light", pictures);
  const auto bracket = read_bracket(session, "light", std::nullopt);
  ASSERT_EQ(bracket.size(), 3u);
  EXPECT_EQ(bracket[2].exposure, 0.04);
  EXPECT_EQ(bracket[2].rgb[0], 100);
}

// Real brackets. Leaving one exposure out, others have found 2 to 5 codes for this camera. Film
// scans, whose three layers have curves of their own, are farther from having one: the bound of 8
// codes is a stated one, a fifth of a stop in the middle of the scale.
TEST(RealResponse, PredictsAnExposureThatWasLeftOut) {
  const fs::path hdr = test::shared_data("real/hdr");
  PREVIZ_NEEDS(hdr);
  const auto window = read_bracket(hdr / "window", "", std::nullopt);  // by their EXIF
  EXPECT_EQ(window.size(), 12u);
  const ResponseFit fit = fit_response(window, ResponseMethod::debevec);
  std::printf("window: %.2f codes\n", fit.error_codes);
  EXPECT_LT(fit.error_codes, 5);
  const auto memorial = read_bracket(hdr / "memorial", "", hdr / "memorial/exposures.txt");
  const ResponseFit film = fit_response(memorial, ResponseMethod::robertson);
  std::printf("memorial: %.2f codes\n", film.error_codes);
  EXPECT_LT(film.error_codes, 8);
}

// Half of the first curve's steps are flat, as where a method finds each code by itself and the
// pictures contradict each other: a hundredth less error is not worth that, a half is.
TEST(ResponseFit, AStaircaseIsNotTakenForAHundredthLessError) {
  ResponseFit stairs, smooth;
  stairs.method = ResponseMethod::robertson;
  stairs.error_codes = 7.76;
  smooth.error_codes = 7.81;
  stairs.brightest = smooth.brightest = 255;
  stairs.flat_steps = 130;
  const std::vector<ResponseFit> fits{smooth, stairs};
  EXPECT_EQ(better_fit(fits).method, ResponseMethod::debevec);
  std::vector<ResponseFit> clear = fits;
  clear[1].error_codes = 3.9;
  EXPECT_EQ(better_fit(clear).method, ResponseMethod::robertson);
}

TEST(ResponseFit, FlatStepsAreCounted) {
  const ResponseFit smooth = fit_response(make_bracket(6, 1.5), ResponseMethod::debevec);
  EXPECT_EQ(smooth.flat_steps, 0);
  EXPECT_GT(smooth.brightest, smooth.darkest);
}

// A camera that clips at code 244 of 255: nothing is known of what lies above.
TEST(ResponseCalibration, AJumpIsNamedWithItsCause) {
  ResponseFit fit = fit_response(make_bracket(6, 1.5), ResponseMethod::debevec);
  EXPECT_TRUE(doubts_of(fit).empty());
  for (std::size_t code = 0; code < 245; ++code) fit.curve.inverse_table[code] *= 0.07;
  EXPECT_THAT(doubts_of(fit), ElementsAre(AllOf(HasSubstr("clips its light at about code 240"),
                                                HasSubstr("give clip_share = 0.94"))));
  // What was measured already need not be given.
  EXPECT_THAT(doubts_of(fit, 244)[0], HasSubstr("clip_share, which counts codes from 244 on"));
  fit.error_codes = 12;
  EXPECT_THAT(doubts_of(fit)[0], HasSubstr("predicted only to 12.0 codes"));
}

}  // namespace previz::calibrate::response_test
