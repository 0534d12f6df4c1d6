// Light sources taken out of environment maps made by code, and what is left.
#include "daemon/core/lighting/sources.hpp"

#include "daemon/core/lighting/bright_regions.hpp"
#include "daemon/core/lighting/light_mode.hpp"
#include "daemon/core/lighting/source_tracker.hpp"
#include "shaders/lib/octahedral.h"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::sources_test {

using namespace previz::test;

constexpr double pi = std::numbers::pi;

struct Disc {
  glm::dvec3 direction;
  double radius_rad;
  glm::dvec3 radiance;
  glm::dvec3 flux() const { return radiance * (2 * pi * (1 - std::cos(radius_rad))); }
};

double angle(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

// Texels are means over 4x4 directions of equal solid angle.
EnvironmentMap map_of(const Sky& sky, int size) {
  constexpr int samples = 4;
  EnvironmentMap map{size, {}};
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      glm::dvec3 sum(0);
      for (int s = 0; s < samples * samples; ++s) {
        const int across = s % samples, down = s / samples;
        const double u = i + (across + 0.5) / samples, v = j + (down + 0.5) / samples;
        const glm::vec2 at(2 * u / size - 1, 2 * v / size - 1);
        sum += sky(glm::dvec3(octahedral_direction(at)));
      }
      map.radiance.emplace_back(sum / (1.0 * samples * samples));
    }
  return map;
}

// Discs over a sky that grows from 0.2 at -Y to 0.4 at +Y.
EnvironmentMap lit_by(const std::vector<Disc>& discs, int size = 256) {
  return map_of(
      [&](const glm::dvec3& direction) {
        glm::dvec3 radiance(0.3 + 0.1 * direction.y);
        for (const Disc& disc : discs)
          if (angle(direction, disc.direction) < disc.radius_rad) radiance += disc.radiance;
        return radiance;
      },
      size);
}

glm::dvec3 flux_of(const std::vector<Source>& sources) {
  glm::dvec3 sum(0);
  for (const Source& source : sources) sum += source.flux;
  return sum;
}

const Source& nearest(const std::vector<Source>& sources, const glm::dvec3& direction) {
  return *std::ranges::max_element(
      sources, {}, [&](const Source& source) { return glm::dot(source.direction, direction); });
}

// Extracts the sources of a map: there must be so many, and no flux may be lost. Both fluxes are
// sums of 65536 floats, whose rounding stays far below 1e-5.
Extraction extract(const EnvironmentMap& map, std::size_t sources) {
  Extraction extraction = extract_sources(map, {});
  EXPECT_EQ(extraction.sources.size(), sources);
  const glm::dvec3 whole = total_flux(map);
  const glm::dvec3 parts = flux_of(extraction.sources) + total_flux(extraction.residual);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(parts[c] / whole[c], 1, 1e-5) << "channel " << c;
  return extraction;
}

// Flux against what the texels have of the disc, of which 16 directions a texel find the area to 5
// % only; the sky varies by 1e-4 of the disc's radiance over ring and disc. The radius goes with
// the root of the area found. A texel is 0.8 degrees wide; the centre of gravity is a mean over 44.
void expect_found(const Disc& disc, const glm::dvec3& flux, const std::vector<Source>& sources) {
  ASSERT_FALSE(sources.empty());
  const Source& source = nearest(sources, disc.direction);
  EXPECT_LT(angle(source.direction, disc.direction), 0.1 * degree);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(source.flux[c] / flux[c], 1, 1e-3);
  EXPECT_NEAR(angular_radius(source) / disc.radius_rad, 1, 0.03);
}

// At the zenith, the nadir (the map's four corners), the seams and folds between them, elsewhere.
TEST(Sources, AreFoundWhereverTheMapFolds) {
  for (const glm::dvec3& direction :
       {glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1), towards(45, 0), towards(0, -40), towards(90, 0),
        towards(180, -60), towards(271, -30), towards(128, 52), towards(200, -2)}) {
    SCOPED_TRACE(testing::Message() << direction.x << ' ' << direction.y << ' ' << direction.z);
    const Disc disc{direction, 3 * degree, {300, 200, 100}};
    const EnvironmentMap map = lit_by({disc});
    const Extraction extraction = extract(map, 1);
    expect_found(disc, total_flux(map) - total_flux(lit_by({})), extraction.sources);
    // The hole is filled with what is around it.
    const float filled =
        extraction.residual.radiance[texel_index(map.size, glm::vec3(direction))].g;
    EXPECT_NEAR(filled, 0.3 + 0.1 * direction.y, 0.01);
  }
}

TEST(Sources, AreTheSameWhateverTheScaleOfTheLight) {
  const Disc disc{towards(30, 40), 3 * degree, {30, 20, 10}};
  const EnvironmentMap map = lit_by({disc});
  const Extraction extraction = extract_sources(map, {});
  for (const float scale : {1e-6f, 1e6f}) {
    EnvironmentMap scaled = map;
    for (glm::vec3& radiance : scaled.radiance) radiance *= scale;
    const Extraction other = extract_sources(scaled, {});
    ASSERT_EQ(other.sources.size(), 1u);
    EXPECT_LT(angle(other.sources[0].direction, extraction.sources[0].direction), 1e-6);
    EXPECT_NEAR(other.sources[0].flux.g / scale / extraction.sources[0].flux.g, 1, 1e-5);
  }
}

// A sun 1e6 times its sky takes neither the sky's place nor the threshold with it.
TEST(Sources, ASunLeavesALampInPlace) {
  const Disc sun{towards(10, 60), 1.5 * degree, {3e5, 3e5, 3e5}};
  const Disc lamp{towards(200, 20), 6 * degree, {900, 900, 900}};
  set::LightSources settings;
  settings.least_share = 1e-3;
  EXPECT_EQ(extract_sources(lit_by({sun, lamp}), settings).sources.size(), 2u);
}

TEST(Sources, ThereAreNoneInASkyOrInTheDark) {
  EXPECT_TRUE(extract_sources(lit_by({}), {}).sources.empty());
  EXPECT_TRUE(extract_sources({1, {glm::vec3(1)}}, {}).sources.empty());
  const EnvironmentMap dark{16, std::vector<glm::vec3>(256, glm::vec3(0))};
  const Extraction extraction = extract_sources(dark, {});
  EXPECT_TRUE(extraction.sources.empty());
  EXPECT_EQ(extraction.residual.radiance, dark.radiance);
}

TEST(Sources, ALampInTheDarkIsFoundAndLeavesNothing) {
  const EnvironmentMap map = map_of(
      [](const glm::dvec3& d) { return glm::dvec3(angle(d, towards(0, 50)) < 3 * degree); }, 128);
  const Extraction extraction = extract_sources(map, {});
  ASSERT_EQ(extraction.sources.size(), 1u);
  EXPECT_EQ(total_flux(extraction.residual), glm::dvec3(0));
}

// Two lamps whose glare has run together: a saddle of 4 between peaks of 40 and 25.
TEST(Sources, LampsThatRanTogetherArePartedAtTheSaddle) {
  const glm::dvec3 left = towards(100, 45), right = towards(117, 45);
  const auto blob = [](const glm::dvec3& at, const glm::dvec3& d, double peak) {
    const double x = angle(at, d) / (2.5 * degree);
    return peak * std::exp(-0.5 * x * x);
  };
  const EnvironmentMap map = map_of(
      [&](const glm::dvec3& d) { return glm::dvec3(0.1 + blob(left, d, 40) + blob(right, d, 25)); },
      256);
  const Extraction extraction = extract(map, 2);
  const Source &first = extraction.sources.at(0), &second = extraction.sources.at(1);
  // A Gaussian's volume, less its tail below the threshold and the ring, about 1.5 of 25: 6 %.
  const double volume = 2 * pi * std::pow(2.5 * degree, 2);
  EXPECT_LT(angle(first.direction, left), 0.5 * degree);
  EXPECT_LT(angle(second.direction, right), 0.5 * degree);
  EXPECT_NEAR(first.flux.g / (40 * volume), 1, 0.06);
  EXPECT_NEAR(second.flux.g / (25 * volume), 1, 0.06);
}

// Noise of a tenth inside one lamp makes many peaks, and one source.
TEST(Sources, AnUnevenLampIsOne) {
  EnvironmentMap map = lit_by({{towards(300, 30), 5 * degree, {50, 50, 50}}});
  for (std::size_t t = 0; t < map.radiance.size(); ++t)
    map.radiance[t] *= 1 + 0.1f * std::sin(static_cast<float>(t * t % 1009));
  EXPECT_EQ(extract_sources(map, {}).sources.size(), 1u);
}

TEST(Sources, AFaintReflectionStaysInTheResidual) {
  const Disc lamp{towards(20, 50), 4 * degree, {100, 100, 100}};
  const Disc reflection{towards(20, -50), 2 * degree, {3, 3, 3}};
  const EnvironmentMap map = lit_by({lamp, reflection});
  const Extraction extraction = extract(map, 1);
  expect_found(lamp, total_flux(lit_by({lamp})) - total_flux(lit_by({})), extraction.sources);
  EXPECT_EQ(extraction.left, 1);
  const std::size_t there = texel_index(map.size, glm::vec3(reflection.direction));
  EXPECT_EQ(extraction.residual.radiance[there], map.radiance[there]);
}

// A lamp that brings a little less than it must: not found, but kept where it was known.
TEST(Sources, AKnownLampIsKeptDownToHalfOfTheLeastShare) {
  const Disc lamp{towards(20, 50), 4 * degree, {3, 3, 3}};
  const EnvironmentMap map = lit_by({lamp});
  const double share = lamp.flux().g / total_flux(map).g;
  set::LightSources settings;
  settings.least_share = share * 1.5;
  EXPECT_TRUE(extract_sources(map, settings).sources.empty());
  const std::vector<Source> known{{1, towards(22, 51), 0.01, glm::dvec3(1)}};
  EXPECT_EQ(extract_sources(map, settings, known).sources.size(), 1u);
  settings.least_share = share * 2.5;
  EXPECT_TRUE(extract_sources(map, settings, known).sources.empty());
}

// A tube of 30 by 3 degrees: cut into pieces at most twice as long as wide, which lie along it.
TEST(Sources, ALongLampIsCutIntoPieces) {
  const EnvironmentMap map = map_of(
      [](const glm::dvec3& d) {
        const bool on = d.x > 0 && std::abs(d.y) < std::sin(15 * degree) &&
                        std::abs(d.z) < std::sin(1.5 * degree);
        return glm::dvec3(on ? 50.1 : 0.1);
      },
      256);
  const Extraction extraction = extract(map, 8);  // 10 : 1, halved three times
  for (const Source& piece : extraction.sources) {
    EXPECT_LT(std::abs(piece.direction.z), std::sin(0.5 * degree));
    EXPECT_NEAR(piece.flux.g / flux_of(extraction.sources).g, 1.0 / 8, 0.02);
  }
}

// A softbox of 90 degrees is no lamp that a disc stands for, even where so little contrast counts.
TEST(Sources, AWideLightStaysInTheResidual) {
  set::LightSources settings;
  settings.contrast = 3;
  const Extraction extraction =
      extract_sources(lit_by({{towards(0, 90), 45 * degree, {40, 40, 40}}}), settings);
  EXPECT_TRUE(extraction.sources.empty());
  EXPECT_EQ(extraction.left, 1);
}

TEST(Sources, OfManyLampsTheStrongestAreTaken) {
  std::vector<Disc> lamps;
  for (int i = 0; i < 40; ++i)
    lamps.push_back({towards(9 * i, 20 + 40 * (i % 2)), 2.5 * degree, glm::dvec3(100 + i)});
  EXPECT_EQ(extract(lit_by(lamps), most_sources).left, 8);
}

TEST(Sources, BlurringKeepsTheFlux) {
  const EnvironmentMap map = lit_by({{towards(20, 50), 4 * degree, {100, 50, 20}}});
  const EnvironmentMap small = blurred(map);
  EXPECT_EQ(small.size, 16);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(total_flux(small)[c] / total_flux(map)[c], 1, 1e-6);
  EXPECT_EQ(blurred(small).radiance, small.radiance);
}

// Of another size than the map's, and none of it touching the threshold of a map of one kind.
TEST(Sources, TheThresholdFollowsWhatIsNoLamp) {
  const EnvironmentMap sky = lit_by({});
  const double mean = total_flux(sky).g / (4 * pi);
  EXPECT_NEAR(bright_threshold(sky, 8), 8 * mean, 1e-6);
  // The lamp's blurred edge below the threshold is all that may move it.
  const EnvironmentMap lit = lit_by({{towards(20, 50), 4 * degree, {1e4, 1e4, 1e4}}});
  EXPECT_NEAR(bright_threshold(lit, 8), 8 * mean, 8 * mean * 0.01);
}

Source source_at(const glm::dvec3& direction, double radius_rad, double flux = 1) {
  return {0, direction, 2 * pi * (1 - std::cos(radius_rad)), glm::dvec3(flux)};
}

TEST(SourceTracker, KeepsIdsWhenTheOrderChangesAndGivesNewOnesToNewLamps) {
  SourceTracker tracker(0.25);
  std::vector<Source> first{source_at(towards(0, 40), 0.05, 3),
                            source_at(towards(90, 40), 0.05, 2)};
  tracker.follow(first, 0);
  EXPECT_EQ(first[0].id, 1);
  EXPECT_EQ(first[1].id, 2);
  std::vector<Source> second{source_at(towards(91, 40), 0.05, 5),
                             source_at(towards(180, 40), 0.05, 4),
                             source_at(towards(1, 40), 0.05, 3)};
  tracker.follow(second, 40'000'000);
  EXPECT_EQ(second[0].id, 2);
  EXPECT_EQ(second[1].id, 3);
  EXPECT_EQ(second[2].id, 1);
  EXPECT_EQ(second[0].flux, glm::dvec3(5));  // what was measured: no lag
}

// Off for a frame and on again is another lamp; the number of the first is not given again.
TEST(SourceTracker, ForgetsWhatIsGone) {
  SourceTracker tracker(0.25);
  std::vector<Source> lamp{source_at(towards(0, 40), 0.05)};
  tracker.follow(lamp, 0);
  std::vector<Source> none;
  tracker.follow(none, 40'000'000);
  EXPECT_TRUE(tracker.known().empty());
  tracker.follow(lamp, 80'000'000);
  EXPECT_EQ(lamp[0].id, 2);
}

// Of white noise of standard deviation s, an exponential average with share a keeps
// s sqrt(a / (2 - a)): 0.28 s for 40 ms frames and 0.25 s.
TEST(SourceTracker, SmoothsTremblingAndFollowsMovement) {
  SourceTracker tracker(0.25);
  double measured = 0, shown = 0;
  for (int i = 0; i < 400; ++i) {
    const double noise = 0.1 * std::sin(static_cast<double>(i * i % 1013));
    std::vector<Source> lamp{source_at(towards(noise, 0), 0.05)};
    measured += std::pow(angle(lamp[0].direction, towards(0, 0)), 2);
    tracker.follow(lamp, 40'000'000LL * i);
    shown += std::pow(angle(lamp[0].direction, towards(0, 0)), 2);
  }
  EXPECT_LT(std::sqrt(shown / measured), 0.5);
  std::vector<Source> moved{source_at(towards(5, 0), 0.08)};  // further than it trembles, and wider
  tracker.follow(moved, 40'000'000LL * 400);
  EXPECT_EQ(moved[0].id, 1);
  EXPECT_LT(angle(moved[0].direction, towards(5, 0)), 1e-9);
  EXPECT_NEAR(angular_radius(moved[0]), 0.08, 1e-9);
}

// What an observer at the light camera gets from a lamp: flux over solid angle and direction.
TEST(LightMode, ALampSendsTheFluxOfItsSource) {
  Source source = source_at(towards(60, 35), 4 * degree);
  source.flux = {3, 2, 1};
  const double sr = source.solid_angle_sr;
  const set::Light distant = lamps_of({source}, {1, 2, 3}, at_infinity).front();
  EXPECT_EQ(distant.type, set::LightType::directional);
  EXPECT_LT(angle(-distant.direction, source.direction), 1e-12);
  EXPECT_NEAR(distant.angular_radius_rad, 4 * degree, 1e-12);
  // Irradiance of a disc facing a plane: radiance * pi sin^2.
  EXPECT_NEAR(distant.emission.r, 3 / sr * pi * std::pow(std::sin(4 * degree), 2), 1e-12);
  EXPECT_EQ(distant.gain_mixed, 1);
  EXPECT_EQ(distant.gain_real, 1);

  const auto distance = [](const glm::dvec3&) { return std::optional(2.5); };
  const set::Light near = lamps_of({source}, {1, 2, 3}, distance).front();
  EXPECT_EQ(near.type, set::LightType::sphere);
  EXPECT_LT(glm::length(near.position - (glm::dvec3(1, 2, 3) + 2.5 * source.direction)), 1e-12);
  // A sphere is seen under the angle whose sine is radius over distance.
  EXPECT_NEAR(std::asin(near.radius_m / 2.5), 4 * degree, 1e-12);
  EXPECT_NEAR(near.emission.r, 3 / sr, 1e-9);
}

TEST(LightMode, SaysWhatIsDropped) {
  const Disc disc{towards(30, 40), 3 * degree, {300, 200, 100}};
  Lighting lighting;
  lighting.environment = lit_by({disc});
  const glm::dvec3 whole = total_flux(lighting.environment);
  set::Lighting settings;
  settings.mode = set::LightMode::sources;
  settings.sources.residual = set::Residual::dropped;
  SourceTracker tracker(0);
  apply_mode(lighting, settings, tracker, 0);
  EXPECT_EQ(total_flux(lighting.environment), glm::dvec3(0));
  const glm::dvec3 kept = flux_of(lighting.sources);
  const glm::dvec3 weights(0.2126, 0.7152, 0.0722);
  EXPECT_NEAR(lighting.report.dropped_share, 1 - glm::dot(kept, weights) / glm::dot(whole, weights),
              1e-5);
  EXPECT_THAT(lighting.report.notes, ElementsAre(HasSubstr("dropped")));
}

TEST(LightMode, HybridAndBlurredKeepTheFluxAndImageChangesNothing) {
  const EnvironmentMap map = lit_by({{towards(30, 40), 3 * degree, {300, 200, 100}}});
  for (const set::LightMode mode :
       {set::LightMode::image, set::LightMode::sources, set::LightMode::hybrid}) {
    Lighting lighting;
    lighting.environment = map;
    set::Lighting settings;
    settings.mode = mode;
    SourceTracker tracker(0);
    apply_mode(lighting, settings, tracker, 0);
    const glm::dvec3 sum = flux_of(lighting.sources) + total_flux(lighting.environment);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c] / total_flux(map)[c], 1, 1e-5);
    EXPECT_EQ(lighting.environment.size, mode == set::LightMode::sources ? 16 : 256);
    EXPECT_EQ(lighting.sources.size(), mode == set::LightMode::image ? 0u : 1u);
  }
}

}  // namespace previz::lighting::sources_test
