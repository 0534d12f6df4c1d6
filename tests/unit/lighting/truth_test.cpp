// Captured light on ground truth sets: the bundled one, and all of the shared folder where it is
// there.
#include "tests/support/shared_data.hpp"
#include "tests/support/test.hpp"
#include "tests/truth/lighting_measure.hpp"

namespace previz::truth::truth_test {

constexpr double degree = std::numbers::pi / 180;

// The same bounds for the sources of the map, and 0.1 % for what sources and residual add up to.
void expect_sources(const LightingMeasure& measure) {
  EXPECT_EQ(measure.sources.size(), measure.lamps.size());
  for (const SourceError& source : measure.sources) {
    std::printf(
        "  lamp %s as a source: %.3f degrees, radius ratio %.3f, flux ratio %.4f %.4f %.4f\n",
        source.lamp.name.c_str(), source.direction_rad / degree, source.radius_ratio,
        source.flux_ratio.r, source.flux_ratio.g, source.flux_ratio.b);
    EXPECT_LT(source.direction_rad, 1 * degree) << source.lamp.name;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(source.flux_ratio[c], 1, 0.05) << source.lamp.name;
  }
  glm::dvec3 flux = lighting::total_flux(measure.extraction.residual);
  for (const lighting::Source& source : measure.extraction.sources) flux += source.flux;
  const glm::dvec3 image = lighting::total_flux(measure.captured.environment);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(flux[c] / image[c], 1, 1e-3);
}

// Bounds are those the light stage is accepted by: irradiance 3 % mean, lamps 1 degree and 5 %.
void expect_captured(const std::filesystem::path& directory) {
  const TruthSet set = load_truth_set(directory);
  const LightingMeasure measure = measure_lighting(set, load_light_frames(set), {});
  std::printf("%s: irradiance error mean %.2f %%, worst %.2f %% over %.2f sr\n", set.name.c_str(),
              100 * measure.irradiance.mean, 100 * measure.irradiance.worst, measure.compared_sr);
  EXPECT_LT(measure.irradiance.mean, 0.03);
  EXPECT_EQ(measure.captured.report.overexposed_sr, 0);
  // No noise here: what is left are pixels half covered by a phantom's silhouette, a band of a
  // pixel (0.4 degrees) along some 10 rad of outline: 0.07 sr of 6, half of it wrong.
  if (measure.resampling) {
    EXPECT_LT(measure.resampling->mean, 0.006);
  }
  for (const LampError& lamp : measure.lamps) {
    std::printf("  lamp %s: %.3f degrees, flux ratio %.4f %.4f %.4f\n", lamp.lamp.name.c_str(),
                lamp.direction_rad / degree, lamp.flux_ratio.r, lamp.flux_ratio.g,
                lamp.flux_ratio.b);
    EXPECT_LT(lamp.direction_rad, 1 * degree) << lamp.lamp.name;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(lamp.flux_ratio[c], 1, 0.05) << lamp.lamp.name;
  }
  expect_sources(measure);
}

TEST(CapturedLight, MatchesTheBundledSet) {
  expect_captured(std::filesystem::path(PREVIZ_SOURCE_DIR) / "tests/truth/data/glass");
}

TEST(CapturedLight, MatchesTheSharedSets) {
  const std::filesystem::path sets = test::shared_data("groundtruth");
  PREVIZ_NEEDS(sets);
  for (const auto& entry : std::filesystem::directory_iterator(sets))
    if (std::filesystem::exists(entry.path() / "set.json")) expect_captured(entry.path());
}

}  // namespace previz::truth::truth_test
