// Brackets whose exposures are not of the same light: what has moved, what was switched, what is
// missing, what is stated wrongly.
#include "daemon/core/lighting/bracket.hpp"

#include "daemon/core/lighting/hdr.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::bracket_test {

const ResponseCurve linear_curve{
    .kind = ResponseCurve::Kind::linear, .inverse_table = {}, .clip_share = 1};
constexpr double wall_radiance = 0.3, lamp_radiance = 500;
constexpr int strip_width = 64, strip_height = 8;

// The i-th frame of a bracket, with the sensor's noise. `scene`: radiance by column.
template <typename Scene>
FramePtr noisy_frame(int i, double exposure, const Scene& scene, std::mt19937& random) {
  const SensorNoise noise;
  std::normal_distribution<double> normal;
  Frame frame = *test::make_frame(strip_width, strip_height, exposure, [&](int x, int) {
    const double mean = exposure * scene(x);
    glm::dvec3 signal(0);
    for (int c = 0; c < 3; ++c)
      signal[c] = mean + normal(random) * std::sqrt(mean * noise.signal_per_electron +
                                                    noise.read_noise * noise.read_noise);
    return signal;
  });
  frame.sequence = static_cast<std::uint64_t>(i);
  frame.timestamp_ns = i * 40'000'000;
  return std::make_shared<Frame>(std::move(frame));
}

// A lamp four pixels wide that moves by six a frame.
double moving_lamp(int frame, int column) {
  return column >= 6 * frame && column < 6 * frame + 4 ? lamp_radiance : wall_radiance;
}

struct Bracketed {
  std::vector<FramePtr> frames;
  HdrPicture merged;
};

Bracketed photograph_moving_lamp(const std::vector<double>& exposures) {
  std::mt19937 random(3);
  Bracketed result;
  for (int i = 0; i < static_cast<int>(exposures.size()); ++i)
    result.frames.push_back(noisy_frame(
        i, exposures[static_cast<std::size_t>(i)],
        [i](int column) { return moving_lamp(i, column); }, random));
  std::shuffle(result.frames.begin(), result.frames.end(), random);  // times decide, not the order
  result.merged = merge_exposures(result.frames, linear_curve);
  return result;
}

glm::vec3 at(const HdrPicture& picture, int column, int row) {
  return picture.radiance[static_cast<std::size_t>(row * picture.width + column)];
}

std::uint8_t flags_at(const HdrPicture& picture, int column, int row) {
  return picture.flags[static_cast<std::size_t>(row * picture.width + column)];
}

TEST(MergeMoving, TheNewestLongExposureShowsTheWallWhereTheLampWas) {
  const std::vector<double> exposures{1.0 / 4096, 1.0 / 256, 1.0 / 16, 1};
  const HdrPicture picture = photograph_moving_lamp(exposures).merged;
  const SensorNoise noise;
  // The long exposure alone sees the wall well: 5 of its standard deviations.
  const double sigma =
      std::sqrt(wall_radiance * noise.signal_per_electron + noise.read_noise * noise.read_noise);
  for (int row = 0; row < strip_height; ++row)
    for (int column = 0; column < strip_width; ++column) {
      const auto is_lit = [column](int frame) {
        return moving_lamp(frame, column) == lamp_radiance;
      };
      const bool lit_before = is_lit(0) || is_lit(1) || is_lit(2);
      if (is_lit(3)) {
        // Clipped at 1 in the newest, and wall in the others, which the shortest, of a standard
        // deviation of 1.2, cannot tell from 1.
        EXPECT_TRUE(flags_at(picture, column, row) & moved) << column;
        EXPECT_GE(at(picture, column, row).r, 1 - noise.calibration_error);
        EXPECT_LE(at(picture, column, row).r, wall_radiance + 5 * noise.read_noise / exposures[0]);
      } else {
        EXPECT_NEAR(at(picture, column, row).g, wall_radiance, 5 * sigma) << column;
        EXPECT_EQ(flags_at(picture, column, row), lit_before ? moved : 0) << column;
      }
    }
}

TEST(MergeMoving, TheNewestShortExposureShowsTheLampWhereItIsNowAndNowhereElse) {
  const std::vector<double> exposures{1, 1.0 / 16, 1.0 / 256, 1.0 / 4096};
  const HdrPicture picture = photograph_moving_lamp(exposures).merged;
  const SensorNoise noise;
  const double signal = lamp_radiance * exposures.back();
  const double sigma =
      std::sqrt(signal * noise.signal_per_electron + noise.read_noise * noise.read_noise) /
      exposures.back();
  for (int row = 0; row < strip_height; ++row)
    for (int column = 0; column < strip_width; ++column) {
      if (moving_lamp(3, column) == lamp_radiance)
        EXPECT_NEAR(at(picture, column, row).r, lamp_radiance, 5 * sigma) << column;
      else  // at most the white of the long exposure, which no newer one can deny there
        EXPECT_LE(at(picture, column, row).r, 1.0f) << column;
    }
}

TEST(MergeMoving, ASwitchedOffLampIsGoneWithTheFirstExposureWithoutIt) {
  std::mt19937 random(5);
  const auto lit = [](int column) { return column < 8 ? lamp_radiance : wall_radiance; };
  const auto dark = [](int) { return wall_radiance; };
  for (const double newest : {1.0, 1.0 / 16, 1.0 / 256, 1.0 / 4096}) {
    std::vector<FramePtr> frames;
    int i = 0;
    for (const double exposure : {1.0, 1.0 / 16, 1.0 / 256, 1.0 / 4096})
      if (exposure != newest) frames.push_back(noisy_frame(i++, exposure, lit, random));
    frames.push_back(noisy_frame(i, newest, dark, random));
    const HdrPicture picture = merge_exposures(frames, linear_curve);
    double flux = 0;
    for (int column = 0; column < 8; ++column) flux += at(picture, column, 2).g / 8;
    // An exposure that clips at 1 leaves that much where the newest one is too short to deny it,
    // and that one its noise.
    EXPECT_LE(flux, 1 + 5 * SensorNoise{}.read_noise / newest) << newest;
    EXPECT_NEAR(at(picture, 40, 2).g, wall_radiance, 0.05 * wall_radiance) << newest;
  }
}

TEST(MergeMoving, AStaticSceneLeavesNothingOut) {
  std::mt19937 random(9);
  std::vector<FramePtr> frames;
  int i = 0;
  for (const double exposure : {1.0 / 4096, 1.0 / 256, 1.0 / 16, 1.0, 4.0})
    frames.push_back(noisy_frame(
        i++, exposure, [](int column) { return 1e-3 * std::pow(1.25, column); }, random));
  const HdrPicture picture = merge_exposures(frames, linear_curve);
  // 5 standard deviations: 6e-7 a comparison, of which there are 6144.
  EXPECT_TRUE(std::ranges::none_of(picture.flags, [](std::uint8_t flag) { return flag & moved; }));
}

// A curve that was fitted where the camera clips near half of white guesses what lies above, and
// may give the codes that are seen a thousandth of their signal. That is a matter of units: the
// same pixels have moved, by the same noise, and the light is a thousandth, up to rounding.
TEST(MergeMoving, ByACurveThatGuessesWhatIsClippedIsTheSameLight) {
  constexpr double units = 1e-3;
  const ResponseCurve whole{
      .kind = ResponseCurve::Kind::table, .inverse_table = {0, 0.5, 1}, .clip_share = 0.49};
  ResponseCurve guessed = whole;
  guessed.inverse_table[1] *= units;
  const auto frames = photograph_moving_lamp({1.0 / 4096, 1.0 / 256, 1.0 / 16, 1}).frames;
  const HdrPicture picture = merge_exposures(frames, whole);
  const HdrPicture by_guess = merge_exposures(frames, guessed);
  EXPECT_EQ(by_guess.flags, picture.flags);
  EXPECT_THAT(picture.flags, Contains(moved));
  for (std::size_t p = 0; p < picture.radiance.size(); ++p)
    EXPECT_NEAR(by_guess.radiance[p].g / units, picture.radiance[p].g,
                1e-6 * picture.radiance[p].g);
}

TEST(MergeExposures, AMissingExposureIsBridgedOrFlagged) {
  const std::vector<double> all{1.0 / 4096, 1.0 / 256, 1.0 / 16, 1.0, 16.0};
  for (std::size_t missing = 0; missing < all.size(); ++missing) {
    const auto radiance = [](std::size_t k) { return 1e-3 * std::pow(1.45, k); };  // to 1400
    std::vector<FramePtr> frames;
    for (std::size_t e = 0; e < all.size(); ++e)
      if (e != missing)
        frames.push_back(test::make_frame(40, 1, all[e], [&](int x, int) {
          return glm::dvec3(all[e] * radiance(std::size_t(x)));
        }));
    const HdrPicture picture = merge_exposures(frames, linear_curve);
    for (std::size_t k = 0; k < 40; ++k) {
      if (picture.flags[k] & overexposed) {
        EXPECT_LT(picture.radiance[k].r, radiance(k));
      } else {
        // Steps of 256 between exposures: the worst signal that is left is 1/256, 256 codes of 16
        // bits, half of one is 0.2 %; where the longest is missing, 1e-3, 65 codes, 0.8 %.
        EXPECT_NEAR(picture.radiance[k].r / radiance(k), 1, 0.008) << missing << " " << k;
      }
    }
  }
}

TEST(MergeExposures, TheDarkLevelIsTakenOff) {
  const glm::dvec3 dark(0.02, 0.01, 0.03);
  const std::vector<glm::dvec3> radiances{glm::dvec3(0), {0.5, 2, 8}, glm::dvec3(100)};
  std::vector<FramePtr> frames;
  for (const double exposure : {0.1, 1.0})
    frames.push_back(test::make_frame(
        3, 1, exposure, [&](int x, int) { return exposure * radiances[std::size_t(x)] + dark; }));
  const HdrPicture picture = merge_exposures(frames, linear_curve, dark);
  EXPECT_EQ(picture.flags, (std::vector<std::uint8_t>{underexposed, 0, overexposed}));
  EXPECT_EQ(picture.radiance[0], glm::vec3(0));
  // Half a code of 16 bits in the exposure that sees it: 1.5e-5 of 0.5, 1.5e-4 of 2 and more.
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(picture.radiance[1][c] / radiances[1][c], 1, 1e-4);
    EXPECT_FLOAT_EQ(picture.radiance[2][c], static_cast<float>((1 - dark[c]) / 0.1));
  }
}

std::vector<FramePtr> static_bracket(const std::vector<double>& true_exposures,
                                     const std::vector<double>& stated) {
  std::mt19937 random(17);
  std::vector<FramePtr> frames;
  for (std::size_t i = 0; i < stated.size(); ++i) {
    Frame frame = *noisy_frame(
        static_cast<int>(i), true_exposures[i],
        [](int column) { return 0.05 * std::pow(1.1, column); }, random);
    frame.exposure = stated[i];
    frames.push_back(std::make_shared<Frame>(std::move(frame)));
  }
  return frames;
}

TEST(Disagreements, AnExposureThatIsTwoStopsWrongIsNamed) {
  const std::vector<double> right{1.0 / 64, 1.0 / 8, 1};
  EXPECT_TRUE(disagreements(Bracket(static_bracket(right, right), linear_curve, {})).empty());
  for (std::size_t wrong = 0; wrong < right.size(); ++wrong)
    for (const double stops : {2.0, -2.0}) {
      std::vector<double> stated = right;
      stated[wrong] *= std::exp2(stops);
      const auto found = disagreements(Bracket(static_bracket(right, stated), linear_curve, {}));
      ASSERT_FALSE(found.empty()) << wrong;
      for (const Disagreement& d : found) {
        EXPECT_TRUE(d.shorter == wrong || d.longer == wrong) << d.shorter << " " << d.longer;
        // Its radiance is too low by what its exposure is too high.
        EXPECT_NEAR(d.stops, d.shorter == wrong ? -stops : stops, 0.1);
      }
    }
}

TEST(Disagreements, AMovingLampIsNone) {
  const auto bracket = photograph_moving_lamp({1.0 / 4096, 1.0 / 256, 1.0 / 16, 1});
  EXPECT_TRUE(disagreements(Bracket(bracket.frames, linear_curve, {})).empty());
}

}  // namespace previz::lighting::bracket_test
