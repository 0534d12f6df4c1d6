// Noise taken out of a composite: as much as its variance foretells, and nothing of what is no
// noise.
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::denoise_test {

constexpr int width = 96, height = 80;
const std::vector<Pixel> all_pixels = pixels_of(width, height);

// A flat wall that covers the whole picture.
render::Layers wall(const std::function<glm::vec3(int x, int y)>& radiance, double variance = 0,
                    double white = 1) {
  render::Layers layers;
  layers.width = width;
  layers.height = height;
  layers.samples = 16;
  layers.white = white;
  for (const auto& [x, y, i] : all_pixels) layers.composite.push_back(radiance(x, y));
  const std::size_t pixels = layers.composite.size();
  layers.mixed = layers.real = layers.diff = layers.composite;
  layers.normal.assign(pixels, glm::vec3(0, 0, 1));
  layers.variance.assign(pixels, glm::vec3(variance));
  layers.mask.assign(pixels, 1.0f);
  layers.depth.assign(pixels, 2.0f);
  return layers;
}

std::function<glm::vec3(int, int)> noise_around(double mean, double deviation, unsigned seed = 1) {
  return [mean, random = std::mt19937(seed),
          normal = std::normal_distribution<double>(0, deviation)](int, int) mutable {
    return glm::vec3(mean + normal(random), mean + normal(random), mean + normal(random));
  };
}

render::Layers denoised(render::Layers layers, const render::PlateRadiance& camera = {},
                        std::size_t most_pixels = std::size_t{1} << 21) {
  render::Denoiser denoiser(*shared_device(), most_pixels);
  denoise(denoiser, layers, camera);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
  return layers;
}

// A plate every sample of which has a code of its own.
struct PlateOf : render::PlateRadiance {
  explicit PlateOf(const std::vector<double>& radiance) : own(radiance.size()) {
    std::iota(own.begin(), own.end(), std::uint16_t{0});
    codes = own;
    for (const double value : radiance) of_code.push_back({value, 0, 0});
  }
  std::vector<std::uint16_t> own;
};

struct Spread {
  double mean = 0, variance = 0, foretold = 0;
  std::size_t values = 0;
};

// Of the first channel's composite where `wanted`.
Spread spread(const render::Layers& layers, const std::function<bool(int x, int y)>& wanted) {
  Spread s;
  double square = 0;
  for (const auto& [x, y, i] : all_pixels) {
    if (!wanted(x, y)) continue;
    const double value = layers.composite[i].r;
    s.mean += value;
    square += value * value;
    s.foretold += layers.variance[i].r;
    ++s.values;
  }
  const auto n = static_cast<double>(s.values);
  s.mean /= n;
  s.variance = square / n - s.mean * s.mean;
  s.foretold /= n;
  return s;
}

bool everywhere(int, int) {
  return true;
}

// The spline of each level keeps (35 / 128)^2 of the variance of independent neighbours; later
// levels see what the ones before have blended, so less than 1 / 50 is left only if most weights
// are near 1: values of one sigma differ by sqrt(2) of it, and exp(-2 / (4 * 2)) = 0.8 is their
// mean weight.
TEST(Denoise, LeavesLittleOfNoiseAndTheMeanAsItIs) {
  const double sigma = 0.05;
  const render::Layers raw = wall(noise_around(0.5, sigma), sigma * sigma);
  const Spread before = spread(raw, everywhere);
  const Spread after = spread(denoised(raw), everywhere);
  EXPECT_LT(after.variance, before.variance / 50);
  EXPECT_NEAR(after.mean, before.mean, 4 * sigma / std::sqrt(static_cast<double>(after.values)));
  EXPECT_GT(after.foretold, after.variance / 3);
  EXPECT_LT(after.foretold, 3 * after.variance);
}

// What a single sample is off by shows in its neighbours only.
TEST(Denoise, OfSingleSamplesTheNeighboursTellTheNoise) {
  const double sigma = 0.05;
  render::Layers raw = wall(noise_around(0.5, sigma), 0);
  EXPECT_EQ(denoised(raw).composite, raw.composite) << "sixteen equal samples: no noise";
  raw.samples = 1;
  EXPECT_LT(spread(denoised(raw), everywhere).variance, sigma * sigma / 50);
}

TEST(Denoise, LeavesWhatDiffersByMoreThanItsNoise) {
  const double sigma = 0.005;
  const auto bright = [](int x, int y) { return (x / 3 + y / 3) % 2 == 0; };
  auto noise = noise_around(0, sigma);
  const render::Layers raw =
      wall([&](int x, int y) { return glm::vec3(bright(x, y) ? 0.6f : 0.3f) + noise(x, y); },
           sigma * sigma);
  const render::Layers clean = denoised(raw);
  for (const bool side : {true, false}) {
    const Spread s = spread(clean, [&](int x, int y) { return bright(x, y) == side; });
    // A weight of one in 300 across would show; of nine pixels of a square some are always blended.
    EXPECT_NEAR(s.mean, side ? 0.6 : 0.3, 1e-3);
    EXPECT_LT(s.variance, sigma * sigma / 2);
  }
}

// Light that few samples meet: a flat real surface on which each sample adds v with probability p
// and nothing otherwise. A filter whose weights come from the values that it averages counts the
// bright ones less, and loses light. 3 % of what was drawn may be lost, a third of the bound on a
// picture's difference. Neighbours that agree are worth 13.4 at the first level and four times as
// many at each further one (denoise.comp), which leaves 1/857 of the variance; a fiftieth allows
// for neighbours that chance makes differ.
TEST(Denoise, KeepsTheMeanOfLightThatFewSamplesMeet) {
  for (const int samples : {1, 4})
    for (const double p : {0.03, 0.1, 0.25}) {
      const double value = 0.025 / p;  // below white
      std::mt19937 random(7);
      std::binomial_distribution<int> hits(samples, p);
      render::Layers raw = wall([](int, int) { return glm::vec3(0); });
      raw.samples = samples;
      double drawn = 0;
      for (std::size_t i = 0; i < raw.mask.size(); ++i) {
        const double n = hits(random), mean = n * value / samples;
        drawn += mean / static_cast<double>(raw.mask.size());
        raw.mask[i] = 0;
        raw.diff[i] = raw.composite[i] = raw.mixed[i] = glm::vec3(mean);
        if (samples > 1)
          raw.variance[i] = glm::vec3((n * value * value / samples - mean * mean) / (samples - 1));
      }
      const Spread after = spread(denoised(raw), everywhere);
      EXPECT_NEAR(after.mean, drawn, 0.03 * drawn) << samples << " samples, " << p;
      const double variance = p * (1 - p) * value * value / samples;
      EXPECT_LT(after.variance, variance / 50) << samples << " samples, " << p;
    }
}

// A pixel that one sample made bright, on a surface where nothing else changes. With full weights
// it keeps at most the square of the spline's middle, 0.14, of its light at the first level, and at
// every further level less than a third of that: below a 25th. Its own neighbourhood is all that
// says how noisy the surface is there, so that weights change across its border, and with them the
// sum of the light, by up to a tenth.
TEST(Denoise, LeavesNoSpeckOfASingleSample) {
  render::Layers raw = wall([](int, int) { return glm::vec3(0); });
  raw.samples = 1;
  for (float& mask : raw.mask) mask = 0;
  const std::size_t speck = 40 * width + 48;
  raw.diff[speck] = raw.composite[speck] = raw.mixed[speck] = glm::vec3(0.5f);
  const render::Layers clean = denoised(raw);
  EXPECT_LT(clean.composite[speck].r, 0.5 / 25);
  const Spread after = spread(clean, everywhere);
  EXPECT_NEAR(after.mean * static_cast<double>(after.values), 0.5, 0.05)
      << "the light is still there";
}

// Two halves of equal brightness but for less than their noise, which only their surfaces tell
// apart.
class DenoiseEdges : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(NormalDepthMask, DenoiseEdges, ::testing::Values(0, 1, 2, 3));

TEST_P(DenoiseEdges, StayBetweenSurfaces) {
  const double sigma = 0.1;
  const auto left = [](int x, int) { return x < width / 2; };
  auto noise = noise_around(0, sigma);
  render::Layers raw =
      wall([&](int x, int y) { return glm::vec3(left(x, y) ? 0.45f : 0.55f) + noise(x, y); },
           sigma * sigma);
  for (const auto& [x, y, i] : all_pixels) {
    if (x < width / 2) continue;
    if (GetParam() == 0) raw.normal[i] = glm::vec3(1, 0, 0);
    if (GetParam() == 1) raw.depth[i] = 2.2f;
    if (GetParam() == 2) raw.mask[i] = 0;   // the difference is as large as the radiance
    if (GetParam() == 3) raw.depth[i] = 0;  // nothing was met
  }
  const render::Layers clean = denoised(raw);
  // Beside the edge, where the halves would be blended first: to nearly nothing of the 0.1, where
  // this leaves nine tenths of it.
  const Spread a = spread(clean, [&](int x, int) { return x == width / 2 - 1; });
  const Spread b = spread(clean, [&](int x, int) { return x == width / 2; });
  EXPECT_NEAR(b.mean - a.mean, 0.1, 4 * std::sqrt((a.variance + b.variance) / height) + 0.01);
}

// Depth rises towards the camera's horizon; what is foretold of a plane is not an edge. With one
// sample a pixel's depth is that of a point anywhere in it.
TEST(Denoise, TakesASlantedPlaneForOneSurface) {
  const double sigma = 0.05;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> jitter(-0.5f, 0.5f);
  render::Layers raw = wall(noise_around(0.5, sigma), sigma * sigma);
  for (const auto& [x, y, i] : all_pixels)
    raw.depth[i] = 1.0f / (0.5f + 0.004f * (static_cast<float>(y) + jitter(random)));
  EXPECT_LT(spread(denoised(raw), everywhere).variance, sigma * sigma / 50);
}

TEST(Denoise, TakesOutliersBeyondWhiteAwayAndLeavesLights) {
  const double sigma = 0.02;
  auto noise = noise_around(0.4, sigma);
  const auto is_lamp = [](int x, int y) { return x < 20 && y < 20; };
  const auto is_outlier = [](int x, int y) { return x == 60 && y == 40; };
  render::Layers raw = wall(
      [&](int x, int y) {
        return is_lamp(x, y) ? glm::vec3(3) : is_outlier(x, y) ? glm::vec3(1000) : noise(x, y);
      },
      sigma * sigma);
  raw.variance[40 * width + 60] = glm::vec3(1e6f);
  for (const int samples : {4, 64, 1024}) {
    raw.samples = samples;
    const render::Layers clean = denoised(raw);
    EXPECT_EQ(spread(clean, is_lamp).mean, 3) << samples;
    EXPECT_LT(spread(clean, is_outlier).mean, 0.8) << samples;
    // The neighbours take no more than a single pixel of white in a first level's 25.
    const auto beside = [&](int x, int y) {
      return !is_outlier(x, y) && std::abs(x - 60) <= 4 && std::abs(y - 40) <= 4;
    };
    EXPECT_NEAR(spread(clean, beside).mean, 0.4, 0.6 / 25) << samples;
  }
}

TEST(Denoise, ScalesWithRadiance) {
  const double sigma = 0.05;
  const render::Layers one = denoised(wall(noise_around(0.5, sigma), sigma * sigma));
  for (const double scale : {1e-6, 1e6}) {
    const render::Layers other = denoised(
        wall(noise_around(0.5 * scale, sigma * scale), sigma * sigma * scale * scale, scale));
    double worst = 0;
    for (std::size_t i = 0; i < one.composite.size(); ++i)
      worst = std::max(worst, std::abs(other.composite[i].r / scale - one.composite[i].r));
    EXPECT_LT(worst, 1e-4 * 0.5) << scale;
  }
}

// Bands with the rows that they depend on, against the picture at once; the variance of single
// samples reaches furthest.
TEST(Denoise, DoesNotDependOnItsBands) {
  const double sigma = 0.05;
  for (const int samples : {1, 16}) {
    render::Layers raw = wall(noise_around(0.5, sigma), sigma * sigma);
    raw.samples = samples;
    for (const auto& [x, y, i] : all_pixels) raw.depth[i] = 2.0f + 0.01f * static_cast<float>(y);
    const render::Layers whole = denoised(raw);
    for (const std::size_t most_rows : {1, 60, 79}) {
      const render::Layers bands = denoised(raw, {}, most_rows * width);
      EXPECT_EQ(bands.composite, whole.composite) << most_rows;
      EXPECT_EQ(bands.variance, whole.variance) << most_rows;
    }
  }
}

TEST(Denoise, TakesPicturesOfASingleRowOrColumn) {
  for (const auto& [columns, rows] : {std::pair(1, 1), std::pair(5, 1), std::pair(1, 5)}) {
    render::Layers raw = wall(noise_around(0.5, 0.05), 0.0025);
    raw.width = columns;
    raw.height = rows;
    const auto pixels = static_cast<std::size_t>(columns * rows);
    for (auto* layer : {&raw.composite, &raw.normal, &raw.variance}) layer->resize(pixels);
    raw.mask.resize(pixels);
    raw.depth.resize(pixels);
    for (const glm::vec3& pixel : denoised(raw).composite)
      for (int c = 0; c < 3; ++c) EXPECT_TRUE(pixel[c] > 0.2f && pixel[c] < 0.8f);
  }
}

// A shadow that halves a checkered plate, of which two pixels in three are at the sensor's white:
// what was clipped is no other, and the squares stay as sharp as the camera saw them, whatever the
// rule.
class DenoiseRules : public ::testing::TestWithParam<set::Composite> {};
INSTANTIATE_TEST_SUITE_P(All, DenoiseRules,
                         ::testing::Values(set::Composite::additive, set::Composite::ratio,
                                           set::Composite::hybrid));

TEST_P(DenoiseRules, KeepThePlatesTexture) {
  const auto camera_at = [](int x, int y) { return (x + y) % 3 == 0 ? 0.5f : 1.0f; };
  const bool multiplied = GetParam() != set::Composite::additive;
  std::vector<double> camera;
  auto noise = noise_around(0, 0.1);
  render::Layers raw = wall([&](int x, int y) {
    const float plate = camera_at(x, y);
    for (int c = 0; c < 3; ++c) camera.push_back(plate);
    return glm::vec3(plate);
  });
  // The model's floor has half of the real one's albedo where the rule forgives that.
  for (std::size_t i = 0; i < raw.mask.size(); ++i) {
    raw.mask[i] = 0;
    raw.real[i] = glm::vec3(0.5f);
    raw.diff[i] = glm::vec3(-0.25f) + noise(0, 0);
    raw.mixed[i] = raw.real[i] + raw.diff[i];
    raw.variance[i] = glm::vec3(0.01f);
  }
  render::Layers clean = raw;
  render::Denoiser denoiser(*shared_device());
  denoise(denoiser, clean, PlateOf(camera), {GetParam(), 0});
  double square = 0;
  for (const auto& [x, y, i] : all_pixels) {
    const float plate = camera_at(x, y);
    const double off = clean.composite[i].r - (multiplied ? 0.5 * static_cast<double>(plate)
                                                          : static_cast<double>(plate) - 0.25);
    square += off * off / (width * height);
  }
  EXPECT_LT(square, 0.01 / 20);
}

// A virtual wall before the left third of a real one on which nothing changes: noise on the one
// does not reach the other.
TEST(Denoise, LeavesARealSurfaceBesideAVirtualOneBitForBit) {
  std::vector<double> camera;
  auto noise = noise_around(0.4, 0.1);
  const auto covered = [](int x) { return x < width / 3; };
  std::mt19937 random(3);
  render::Layers raw = wall(
      [&](int x, int y) {
        for (int c = 0; c < 3; ++c) camera.push_back(std::ldexp(1.0 * (random() & 0xffffu), -16));
        if (covered(x)) return noise(x, y);
        return glm::vec3(glm::dvec3(camera.end()[-3], camera.end()[-2], camera.end()[-1]));
      },
      0.01);
  for (const auto& [x, y, i] : all_pixels) {
    if (x < width / 3) continue;
    raw.mask[i] = 0;
    raw.diff[i] = glm::vec3(0);
    raw.variance[i] = glm::vec3(0);
  }
  const render::Layers clean = denoised(raw, PlateOf(camera));
  for (const auto& [x, y, i] : all_pixels) {
    if (x < width / 3) continue;
    EXPECT_EQ(clean.composite[i], raw.composite[i]) << x << ", " << y;
  }
  EXPECT_LT(spread(clean, [&](int x, int) { return covered(x); }).variance, 0.01 / 20);
}

// The edge of a virtual wall before a real one, one pixel wide: each of its pixels is met by four
// samples, so that its light is raw where its neighbours' is not. It becomes the mixture of both
// sides by its own share.
TEST(Denoise, MixesAnEdgeOfItsSidesByItsOwnShare) {
  constexpr double object = 0.7, behind = -0.2, sigma = 0.1;
  constexpr int edge = width / 2;
  const auto share = [](int y) { return 0.2f + 0.6f * static_cast<float>(y) / height; };
  auto noise = noise_around(0, sigma);
  render::Layers raw = wall([](int, int) { return glm::vec3(0); }, sigma * sigma);
  for (const auto& [x, y, i] : all_pixels) {
    const float mask = x < edge ? 1.0f : x > edge ? 0.0f : share(y);
    raw.mask[i] = mask;
    raw.mixed[i] = glm::vec3(object) + noise(x, y);
    raw.diff[i] = glm::vec3(behind) + (x > edge ? noise(x, y) : glm::vec3(0));
  }
  const std::vector<double> camera(3 * raw.composite.size(), 0.5);
  const render::Layers clean = denoised(raw, PlateOf(camera));
  double before = 0, after = 0, bias = 0;
  for (int y = 0; y < height; ++y) {
    const auto i = static_cast<std::size_t>(y) * width + edge;
    const double m = raw.mask[i], expected = m * object + (1 - m) * (behind + 0.5);
    const double was = m * raw.mixed[i].r + (1 - m) * (raw.diff[i].r + 0.5);
    before += std::pow(was - expected, 2);
    after += std::pow(clean.composite[i].r - expected, 2);
    bias += (clean.composite[i].r - expected) / height;
  }
  // The 25 pixels around show the object with 10 whole pixels, which hardly have noise left, and
  // with a share m of the 5 of the edge: those leave 5 m^2 / (10 + 5 m)^2 of the variance, at most
  // a 45th. What the levels leave of the others', 1/857 each, is far less; twice as much as all and
  // a little more is allowed. The noise of the column as a whole, sigma / sqrt(height) at most,
  // enters by that share of 5 m / (10 + 5 m), below 1 / sqrt(10).
  EXPECT_LT(after, before / 10);
  EXPECT_LT(std::abs(bias), 4 * sigma / std::sqrt(10.0 * height));
}

// A contact shadow of four samples beside a virtual wall: a sample is in shadow with a probability
// that falls to 1 / e over three pixels. From the fourth pixel on no more is there than what the
// first two levels, whose steps are finer than that, could bring: a blur of variance v multiplies
// an exponential that falls over L by exp(v / 2 L^2), and the spline's variance is the step
// squared.
TEST(Denoise, LeavesAContactShadowWhereItIs) {
  constexpr int foot = width / 4, samples = 4;
  constexpr double shadow = -0.25;
  constexpr double falls_over = 3, most_blur = 1 + 2 * 2;
  double drawn = 0, shown = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    std::mt19937 random(seed);
    render::Layers raw = wall([](int, int) { return glm::vec3(0); });
    raw.samples = samples;
    for (const auto& [x, y, i] : all_pixels) {
      if (x < foot) continue;
      std::binomial_distribution<int> hits(samples, 0.6 * std::exp((foot - x) / falls_over));
      const double n = hits(random), mean = n * shadow / samples;
      raw.mask[i] = 0;
      raw.diff[i] = raw.mixed[i] = glm::vec3(mean);
      raw.variance[i] = glm::vec3((n * shadow * shadow / samples - mean * mean) / (samples - 1));
    }
    const std::vector<double> camera(3 * raw.composite.size(), 0.5);
    const render::Layers clean = denoised(raw, PlateOf(camera));
    for (const auto& [x, y, i] : all_pixels) {
      if (x < foot + 4) continue;
      drawn += raw.diff[i].r;
      shown += clean.composite[i].r - 0.5;
    }
  }
  EXPECT_LT(shown / drawn, std::exp(most_blur / (2 * falls_over * falls_over)));
  EXPECT_GT(shown / drawn, 0.97);
}

// What is no noise stays: a bright rim on the edge that every sample meets.
TEST(Denoise, LeavesTheRimOfAnEdge) {
  constexpr int edge = width / 2;
  render::Layers raw = wall([](int, int) { return glm::vec3(0); }, 1e-6);
  for (const auto& [x, y, i] : all_pixels) {
    raw.mask[i] = x < edge ? 1.0f : x > edge ? 0.0f : 0.5f;
    raw.mixed[i] = glm::vec3(x == edge ? 0.9f : 0.3f);
    raw.diff[i] = glm::vec3(0);
  }
  const render::Layers clean =
      denoised(raw, PlateOf(std::vector<double>(3 * raw.composite.size(), 0.5)));
  for (int y = 0; y < height; ++y) {
    const auto i = static_cast<std::size_t>(y) * width + edge;
    // Noise explains 5 * 1e-6 of 5 * 0.3^2, which is how far it moves by 0.3.
    EXPECT_NEAR(clean.composite[i].r, 0.5 * 0.9 + 0.5 * 0.5, 0.001);
  }
}

TEST(Denoise, ChangesNoOtherLayerAndNoUntouchedPlate) {
  const View view = random_scene(3, {.width = 70, .height = 50, .virtual_objects = 0});
  SetRenderer renderer(view);
  for (const int bits : {8, 16}) {
    const Plate plate = random_plate(70, 50, bits);
    renderer.begin({std::make_shared<const Plate>(plate), 0.85, view.world_from_camera});
    renderer.render(2);
    const render::Layers raw = renderer.layers();
    render::Layers clean = raw;
    EXPECT_EQ(renderer.show(true, &clean).samples, plate.samples) << bits << " bits";
    EXPECT_EQ(clean.composite, raw.composite) << bits << " bits";
    EXPECT_TRUE(clean.denoised);
    EXPECT_FALSE(raw.denoised);
    EXPECT_EQ(clean.mixed, raw.mixed);
    EXPECT_EQ(clean.real, raw.real);
    EXPECT_EQ(clean.diff, raw.diff);
    EXPECT_EQ(clean.mask, raw.mask);
  }
}

// A virtual wall with stripes from dark to bright, eight pixels wide, whose one sample a pixel
// comes from one of two panels of light. Its albedo is known, so that the light on it comes out as
// clean as on the same wall in the stripes' mean grey. What is left is that a sample's albedo is
// that of a point of its pixel: a stripe of period 8 and amplitude a has a slope of at most 2 pi a
// / 8 a pixel, and on average over stripes and pixels a standard deviation of 2 pi a / 8 / sqrt(2)
// / sqrt(12).
TEST(Denoise, KeepsTheTextureOfAnObject) {
  constexpr int columns = 64, rows = 48;
  constexpr double mean_albedo = 0.5, amplitude = 0.4, period_px = 8;
  const auto wall_with = [](bool stripes) {
    View view = empty_view({0, 0, 2}, {0, 0, 0}, pinhole(columns, rows, 2 * std::atan(0.5)));
    scene::Texture texture = texture_of(4 * columns, 1);
    for (int x = 0; x < texture.width; ++x) {
      const double phase = 2 * std::numbers::pi * (x + 0.5) / 4 / period_px;
      const double albedo = mean_albedo + (stripes ? amplitude * std::sin(phase) : 0);
      texture.texels.emplace_back(glm::vec3(static_cast<float>(albedo)), 1.0f);
    }
    scene::Material paint = diffuse(glm::vec3(1));
    paint.base_color_texture = add_texture(view.scene, texture);
    // Two metres before a camera that sees two metres: the texture is as wide as the picture.
    add(view.scene, rectangle_mesh({2, 2}), paint, glm::dmat4(1), scene::world_mixed);
    for (const double side : {-1.0, 1.0}) {
      set::Light panel = lamp(set::LightType::rectangle, glm::dvec3(2));
      panel.position = {2 * side, 0, 3};
      view.scene.lights.push_back(panel);
    }
    return view;
  };
  const auto error_of = [](const View& view) {
    SetRenderer renderer(view, up_to_depth(1));
    const render::Layers truth = renderer.rendered_clean(128, 9);
    render::Layers clean = renderer.rendered_clean(1, 1);
    renderer.show(true, &clean);
    double square = 0;
    for (std::size_t i = 0; i < truth.composite.size(); ++i)
      square += std::pow(clean.composite[i].g - truth.composite[i].g, 2);
    return std::sqrt(square / columns / rows) / mean(truth.composite).g;
  };
  const double plain = error_of(wall_with(false));
  const double within =
      2 * std::numbers::pi * amplitude / period_px / std::sqrt(24.0) / mean_albedo;
  EXPECT_LT(error_of(wall_with(true)), 1.2 * std::hypot(plain, within)) << plain << ", " << within;
}

// On rendered sets, against many samples: nearer to the truth, and with more samples nearer still.
// The least that the denoiser must take away is a stated bound: a tenth of the squared error, which
// as many more samples would. The limit's own noise, at most 16 / 512 = 3 % of the raw picture's
// squared error, is in both of the errors that are compared.
TEST(Denoise, BringsARenderedPictureNearerToItsLimit) {
  for (const unsigned seed : {2u, 3u}) {
    const View view = random_scene(seed, {.width = 96, .height = 72});
    SetRenderer renderer(view);
    const render::Layers limit = renderer.rendered_clean(512, 99);
    const auto error = [&](const render::Layers& layers) {
      double sum = 0;
      for (std::size_t i = 0; i < layers.composite.size(); ++i) {
        const glm::dvec3 off = glm::min(layers.composite[i], glm::vec3(1.0f)) -
                               glm::min(limit.composite[i], glm::vec3(1.0f));
        sum += glm::dot(off, off);
      }
      return std::sqrt(sum / static_cast<double>(layers.composite.size()));
    };
    double before = 1e9;
    for (const int samples : {1, 4, 16}) {
      const render::Layers raw = renderer.rendered_clean(samples, 1);
      render::Layers clean = raw;
      renderer.show(true, &clean);
      EXPECT_LT(error(clean), std::sqrt(0.9) * error(raw)) << seed << ", " << samples << " samples";
      EXPECT_LT(error(clean), before) << seed << ", " << samples << " samples";
      before = error(clean);
    }
  }
}

}  // namespace previz::test::denoise_test
