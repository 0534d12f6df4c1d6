// The balance between the cameras: its statistics, and on ground truth sets, whose two cameras see
// by one scale and whose surfaces have known albedos.
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/sensor/balance_fit.hpp"
#include "daemon/tools/calibrate/sensor/paper.hpp"
#include "daemon/tools/calibrate/sensor/rotation_fit.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/truth/truth_take.hpp"

namespace previz::calibrate::balance_test {

namespace fs = std::filesystem;

// Surfaces seen in 12 tiles of 20 pixels, whose albedo is `wrong` times what the model says.
// `uneven` is by how much the light of a surface differs from tile to tile.
SurfacePixels make_pixels(const std::vector<double>& wrong, const glm::dvec3& scale,
                          unsigned seed = 1, const std::vector<double>& uneven = {}) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  SurfacePixels seen;
  seen.world_from_cameras.resize(3);
  for (std::uint32_t s = 0; s < wrong.size(); ++s) {
    seen.surfaces.push_back({"surface " + std::to_string(s), glm::dvec3(0.3)});
    for (std::uint32_t tile = 0; tile < 12; ++tile) {
      const double of_tile = std::exp((uneven.empty() ? 0.02 : uneven[s]) *
                                      noise(random));  // light that is not quite right
      for (int p = 0; p < 20; ++p) {
        SurfacePixel pixel{s, tile, {}, glm::dvec3(0.4)};
        pixel.plate = 0.4 * scale * wrong[s] * of_tile * std::exp(0.05 * noise(random));
        seen.pixels.push_back(pixel);
      }
    }
  }
  return seen;
}

// Stated deviations against true errors: 40 sets of pixels, three channels that share their tiles'
// errors. The mean square of 40 unit normals is 1 within 4 sqrt(2/40) = 0.9; the stated deviation
// is of a median of few and made larger for that, so below 1 is no fault.
TEST(BalanceFit, ErrorsAreAsLargeAsStated) {
  const glm::dvec3 truth(1.3, 1.0, 0.8);
  double squares = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const Balance balance = fit_balance(make_pixels({1, 1, 1, 1}, truth, seed), {});
    for (int c = 0; c < 3; ++c)
      squares += std::pow(std::log(balance.scale[c] / truth[c]) / balance.sigma[c], 2) / 3;
  }
  EXPECT_LT(squares / 40, 1.9);
  EXPECT_GT(squares / 40, 0.1);
}

TEST(BalanceFit, OneWrongAlbedoOfFourDoesNoHarm) {
  const Balance balance = fit_balance(make_pixels({1, 1, 1.6, 1}, glm::dvec3(1.2)), {});
  EXPECT_NEAR(std::log(balance.scale.g / 1.2), 0, 5 * 0.02);
  const AlbedoEstimate estimate =
      albedo_of(balance.surfaces[2], {"surface 2", glm::dvec3(0.3)}, balance);
  EXPECT_NEAR(estimate.albedo.g, 0.48, 4 * estimate.sigma.g);
}

// A wall under even light, and a floor that shadows leave known to a factor of two at best and that
// is off by six: with equal weights the balance was their mean, and the wall's albedo came out
// above
// 1. Its weight is (0.1^2 + 0.02^2) / (0.1^2 + s^2) < 3 % of the wall's for a deviation s of 0.6 or
// more, and moves the balance by less than 3 % of log 6.
TEST(BalanceFit, ASurfaceThatIsHardlyKnownMovesNothing) {
  const SurfacePixels seen = make_pixels({1, 1 / 6.0}, glm::dvec3(1.5), 3, {0.02, 2.5});
  const Balance balance = fit_balance(seen, {});
  ASSERT_GT(balance.surfaces[1].sigma.g, 0.6);
  const double of_wall = std::log(balance.surfaces[0].ratio.g);
  EXPECT_NEAR(std::log(balance.scale.g), of_wall, 0.03 * (std::log(6) + 3 * 0.6));
  EXPECT_LT(albedo_of(balance.surfaces[0], {"wall", glm::dvec3(0.7)}, balance).albedo.g, 1);
  // That the two contradict each other is not hidden, but is no factor of three either.
  EXPECT_GT(balance.sigma.g, balance.surfaces[0].sigma.g);
  EXPECT_LT(balance.sigma.g, 0.5);
}

// Surfaces that are known alike count alike, as they always did: the median of three and of four.
TEST(BalanceFit, SurfacesKnownAlikeCountAlike) {
  const Balance three = fit_balance(make_pixels({1, 2, 4}, glm::dvec3(1)), {});
  EXPECT_NEAR(std::log(three.scale.g / 2), 0, 0.05);
  const Balance four = fit_balance(make_pixels({1, 2, 4, 8}, glm::dvec3(1)), {});
  EXPECT_NEAR(std::log(four.scale.g / std::sqrt(8.0)), 0, 0.05);
}

TEST(BalanceFit, ReferencesAloneCountWhereTheyAreNamed) {
  const auto seen = make_pixels({1, 2, 2, 2}, glm::dvec3(1));
  const Balance balance = fit_balance(seen, {"surface 0"});
  EXPECT_NEAR(std::log(balance.scale.r), 0, 4 * balance.sigma.r);
  const std::string unknown = test::error_of([&] { fit_balance(seen, {"grey card"}); });
  EXPECT_THAT(unknown, HasSubstr("surface 0, surface 1"));
}

// Four white cells of a tag are pixels that were chosen with care.
TEST(BalanceFit, ASurfaceSaysHowManyPixelsOfATileAreEnough) {
  auto seen = make_pixels({1, 2}, glm::dvec3(1));
  std::size_t of_second = 0;
  std::erase_if(seen.pixels,
                [&](const SurfacePixel& pixel) { return pixel.surface == 1 && ++of_second > 4; });
  EXPECT_EQ(fit_balance(seen, {}).surfaces.size(), 1u);
  seen.surfaces[1].least_pixels = 2;
  EXPECT_EQ(fit_balance(seen, {}).surfaces.size(), 2u);
}

TEST(BalanceFit, NothingSeenIsSaid) {
  EXPECT_THROW(fit_balance({}, {}), Error);
  auto few = make_pixels({1}, glm::dvec3(1));
  few.pixels.resize(5);
  EXPECT_THROW(fit_balance(few, {}), Error);
}

TEST(BalanceTables, AreWhatASetFileTakes) {
  const set::Set set = set::parse_set(
      set::balance_toml({1.5, 1, 0.75}) + set::surface_toml({"table top", {0.5, 0.25, 0.125}}),
      "printed.toml");
  EXPECT_EQ(set.lighting.balance, glm::dvec3(1.5, 1, 0.75));
  ASSERT_EQ(set.surfaces.size(), 1u);
  EXPECT_EQ(set.surfaces[0].material, "table top");
  EXPECT_EQ(set.surfaces[0].albedo, glm::dvec3(0.5, 0.25, 0.125));
}

// The bundled set as a take, its light camera's exposures `light_factor` times what they were, and
// more in its set file.
class TruthBalance : public testing::Test {
 protected:
  SurfacePixels probe(double light_factor, const std::string& more = "",
                      const std::vector<std::string>& estimator = {}) {
    truth::TruthSet set =
        truth::load_truth_set(fs::path(PREVIZ_SOURCE_DIR) / "tests/truth/data/glass");
    for (truth::LightFrame& frame : set.light_frames) frame.exposure *= light_factor;
    truth::TakeOptions options;
    options.light = truth::LightFrom::captured;
    options.estimator = estimator;
    const fs::path session = directory_ / ("take" + std::to_string(takes_++));
    truth::write_take(set, options, session);
    const fs::path set_file = session / "changed.toml";
    std::ofstream(set_file) << truth::set_file_text(set, options) << more;
    pipeline::Take take = pipeline::open_take(session, set_file);
    if (!device_) device_ = render::open_device();
    const scene::Scene scene = scene::load_scene(take.set);
    SurfaceProbe surfaces(take, scene, device_, {.width = 80});
    ObserverCalibration camera = take.observer;
    camera.response.clip_share = clip_share_;
    Paper paper(take.set, camera, scene, device_, 32);
    each_probed_shot(take, frames_, [&](const ProbedShot& shot) {
      surfaces.add(shot);
      paper.look_at(shot);
      plates_.emplace_back(shot.plate);
      held_.push_back(
          std::ranges::count_if(plates_, [](const auto& plate) { return !plate.expired(); }));
    });
    paper_ = paper.seen();
    why_not_ = paper.why_not();
    return surfaces.compare(scene, 16);
  }

  SurfacePixels paper_;  // of the last probe
  double clip_share_ = ResponseCurve{}.clip_share;
  std::string why_not_;                             // was there no paper
  std::vector<std::weak_ptr<const Plate>> plates_;  // of all probes
  std::vector<std::ptrdiff_t> held_;                // of them, at each visit
  int frames_ = 1;
  test::TemporaryDirectory directory_;
  std::shared_ptr<render::Device> device_;
  int takes_ = 0;
};

void print(const SurfacePixels& seen, const Balance& balance) {
  for (const SurfaceRatio& surface : balance.surfaces)
    std::printf("  %s: %.3f %.3f %.3f +- %.3f, %zu pixels\n",
                seen.surfaces[surface.surface].material.c_str(), surface.ratio.r, surface.ratio.g,
                surface.ratio.b, surface.sigma.g, surface.pixels);
  std::printf("balance %.4f %.4f %.4f +- %.4f %.4f %.4f\n", balance.scale.r, balance.scale.g,
              balance.scale.b, balance.sigma.r, balance.sigma.g, balance.sigma.b);
}

// A hundred plates of 4K would take 5 GB.
TEST_F(TruthBalance, HoldsNoPlateBeyondItsComparison) {
  frames_ = 2;
  const SurfacePixels seen = probe(1);
  EXPECT_EQ(plates_.size(), seen.world_from_cameras.size());
  EXPECT_GT(plates_.size(), 1u);
  EXPECT_LE(std::ranges::max(held_), 1);
}

TEST_F(TruthBalance, CamerasOfOneScaleAreFoundToBe) {
  const SurfacePixels seen = probe(1);
  const Balance balance = fit_balance(seen, {});
  print(seen, balance);
  // Captured light is right to 3 % of irradiance (what the light stage is held to).
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(balance.scale[c], 1, 0.03 + 3 * balance.sigma[c]);
}

// What is not real is left out before the surfaces are looked at; a deformed one had named its
// place among the instances, which was then another's or none.
TEST_F(TruthBalance, AMovingVirtualObjectDoesNoHarm) {
  const SurfacePixels without = probe(1);
  const SurfacePixels with =
      probe(1, "\n[[object]]\nname = \"sprout\"\nfile = \"" PREVIZ_SOURCE_DIR
               "/config/demo/sprout.glb\"\npresence = \"virtual\"\nanimation = \"sway\"\n");
  ASSERT_EQ(with.surfaces.size(), without.surfaces.size());
  EXPECT_EQ(with.pixels.size(), without.pixels.size());
}

TEST_F(TruthBalance, ExposuresWrongByTwoStopsAreFound) {
  const Balance balance = fit_balance(probe(4), {});
  EXPECT_NEAR(exposure_error_stops(balance), 2, 0.1);
  EXPECT_LT(exposure_error_sigma_stops(balance), 0.1);
}

// P25: a phantom whose colour was guessed, beside a table that was measured. The set's own albedo
// comes back, to the 3 % of captured light and what the guess throws on itself.
TEST_F(TruthBalance, TheAlbedoOfAGuessedSurfaceIsFound) {
  const SurfacePixels seen =
      probe(1, "[[surface]]\nmaterial = \"red\"\nalbedo = [0.3, 0.3, 0.3]\n");
  const Balance balance = fit_balance(seen, {"table"});
  const auto red = std::ranges::find_if(balance.surfaces, [&](const SurfaceRatio& surface) {
    return seen.surfaces[surface.surface].material == "red";
  });
  ASSERT_NE(red, balance.surfaces.end());
  const AlbedoEstimate estimate = albedo_of(*red, seen.surfaces[red->surface], balance);
  std::printf("red: %.3f %.3f %.3f +- %.3f %.3f %.3f\n", estimate.albedo.r, estimate.albedo.g,
              estimate.albedo.b, estimate.sigma.r, estimate.sigma.g, estimate.sigma.b);
  const glm::dvec3 truth(0.60, 0.08, 0.06);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(estimate.albedo[c], truth[c], 0.05 * truth[c] + 3 * estimate.sigma[c]);
}

// The paper of printed tags is known where nothing else is: the model's colours are guessed, and
// the light is off by a stop and more of colour. Paper is Lambertian and 0.79 in the set; its
// cells' codes and 32 samples of a tag leave 1 %, and captured light 3 %.
TEST_F(TruthBalance, ThePaperOfTagsIsAGreyCard) {
  SurfacePixels seen = probe(2,
                             "[[surface]]\nmaterial = \"red\"\nalbedo = [0.3, 0.3, 0.3]\n"
                             "[[surface]]\nmaterial = \"table\"\nalbedo = [0.9, 0.2, 0.2]\n");
  append(paper_, seen);
  const Balance balance = fit_balance(seen, {});
  print(seen, balance);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(balance.scale[c] / 2, 1, 0.04);
  for (const SurfaceRatio& surface : balance.surfaces)
    EXPECT_EQ(surface.reference, seen.surfaces[surface.surface].material == paper_name);
  const Balance by_red = fit_balance(seen, {"red"});
  EXPECT_GT(std::abs(std::log(by_red.scale.g / 2)), 0.5) << "a named reference goes before paper";
}

TEST_F(TruthBalance, WhyThereIsNoPaperIsSaid) {
  probe(1);
  EXPECT_EQ(why_not_, "");
  clip_share_ = 0.5;
  probe(1);
  EXPECT_TRUE(paper_.pixels.empty());
  EXPECT_THAT(why_not_, HasSubstr("it is overexposed wherever a tag is large enough"));
}

// A set that traces differences alone has the same paper.
TEST_F(TruthBalance, ThePaperIsRenderedWholeByEitherEstimator) {
  probe(1, "", {"kind = \"difference\""});
  ASSERT_FALSE(paper_.pixels.empty());
  const Balance balance = fit_balance(paper_, {});
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(balance.scale[c], 1, 0.04);
}

// An environment that is turned, by the shadows of the set's cubes, whose colours are guessed, at a
// third of its brightness. Twice 0.5 degrees are what a fit can state; samples leave as much again.
TEST_F(TruthBalance, ATurnedEnvironmentIsFoundByItsShadows) {
  const truth::TruthSet set =
      truth::load_truth_set(fs::path(PREVIZ_SOURCE_DIR) / "tests/truth/data/glass");
  truth::TakeOptions options;
  options.lighting = {"environment_gain = 0.3", "environment_rotation_deg = 70"};
  const fs::path session = directory_ / "turned";
  truth::write_take(set, options, session);
  const fs::path set_file = session / "changed.toml";
  std::ofstream(set_file) << truth::set_file_text(set, options)
                          << "[[surface]]\nmaterial = \"red\"\nalbedo = [0.3, 0.3, 0.3]\n";
  const pipeline::Take take = pipeline::open_take(session, set_file);
  const scene::Scene scene = scene::load_scene(take.set);
  const auto device = render::open_device();
  const ShadingAt shading = shading_of(take, scene, device, 1, 64);
  const RotationFit fit = fit_rotation(
      [&](double rotation_rad, int samples) { return shading(rotation_rad, samples / 2); });
  std::printf("turned by %.2f +- %.2f degrees, off by %.3f, unturned %.3f, second %.2f\n",
              fit.rotation_rad / degree, fit.sigma_rad / degree, fit.off, fit.off_unturned,
              fit.second);
  EXPECT_NEAR(fit.rotation_rad / degree, -70, 2 + 3 * fit.sigma_rad / degree);
  EXPECT_LT(fit.sigma_rad / degree, 2);
  EXPECT_TRUE(fit.is_certain());
}

// A flat table under an even sky looks the same however that is turned.
TEST(RotationFit, IsNotCertainWhereNothingTellsThemApart) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1e-3);
  const RotationFit fit = fit_rotation([&](double, int) {
    return ShadingOff{0.01 * std::exp(noise(random)), 100};
  });
  EXPECT_FALSE(fit.is_certain());
}

// Squares differ by the light alone: neither colours nor a thing that a frame alone shows count.
TEST(ShadingOff, IsOfTheLightAndNotOfColours) {
  const auto seen = [](double shadow, double card) {
    SurfacePixels pixels;
    pixels.surfaces = {{"table", glm::dvec3(0.5)}, {"wall", glm::dvec3(0.2)}};
    for (std::uint32_t frame = 0; frame < 2; ++frame)
      for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 64; ++x) {
          SurfacePixel pixel{.surface = std::uint32_t(y < 24), .frame = frame};
          pixel.px = {10 * x, 10 * y};
          pixel.rendered = glm::dvec3(0.3);
          pixel.plate = glm::dvec3(x < 20 ? shadow : 1) * (y < 24 ? 3.0 : 0.5);
          if (frame == 1 && x > 40) pixel.plate *= card;
          pixels.pixels.push_back(pixel);
        }
    return shading_off(pixels).mean_square;
  };
  EXPECT_LT(seen(1, 1), 2e-4);
  EXPECT_GT(seen(0.8, 1), 20 * seen(1, 1));
  EXPECT_LT(seen(1, 0.1), 0.5 * seen(0.8, 0.1)) << "a card in one frame hides the other's shadow";
}

}  // namespace previz::calibrate::balance_test
