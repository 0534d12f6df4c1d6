// How evenly samples are spread: over a pixel, and over pixels next to each other, whose errors are
// to cancel. All pixels see one point under a sky that is bright on one side, so that a sample
// brings all or nothing.
#include "tests/support/render_fixture.hpp"

namespace previz::test::sampling_test {

constexpr int side = 64;

View half_lit_point() {
  View view = lit_point(0.5);
  view.calibration.intrinsics = pinhole(side, side, 1e-4).intrinsics;
  view.environment = uniform_environment(glm::vec3(0), 64);
  for (std::size_t i = 0; i < view.environment.radiance.size(); ++i) {
    const auto column = static_cast<int>(i % 64), row = static_cast<int>(i / 64);
    if (lighting::texel_direction(64, column, row).x > 0.2f)
      view.environment.radiance[i] = glm::vec3(1);
  }
  return view;
}

std::vector<double> rendered(int samples) {
  const Rendered result =
      render_clean(half_lit_point(), samples, up_to_depth(1), set::LightSampling::bsdf);
  std::vector<double> values;
  for (const glm::vec3& pixel : result.layers.mixed) values.push_back(pixel.g);
  return values;
}

double variance(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double v : values) {
    sum += v;
    squares += v * v;
  }
  const auto n = static_cast<double>(values.size());
  return (squares - sum * sum / n) / (n - 1);
}

// Means over squares of `size` pixels, the first one at (offset, offset).
std::vector<double> square_means(const std::vector<double>& pixels, int size, int offset) {
  std::vector<double> means;
  for (int y = offset; y + size <= side; y += size) {
    for (int x = offset; x + size <= side; x += size) {
      double sum = 0;
      for (int v = y; v < y + size; ++v)
        for (int u = x; u < x + size; ++u) sum += pixels[static_cast<std::size_t>(v * side + u)];
      means.push_back(sum / (size * size));
    }
  }
  return means;
}

// The variance of n means of m values each over what it would be of independent values is 1 for
// those, within three standard errors of a variance, sqrt(2 / (n - 1)).
void expect_better_than_independent(double ratio, std::size_t n) {
  EXPECT_LT(ratio, 1 - 3 * std::sqrt(2 / (static_cast<double>(n) - 1)));
}

TEST(Sampling, SpreadsAPixelsSamples) {
  const double one = variance(rendered(1));
  for (const int samples : {4, 16, 64}) {
    SCOPED_TRACE(samples);
    expect_better_than_independent(samples * variance(rendered(samples)) / one, side * side);
  }
}

TEST(Sampling, SpreadsThoseOfNeighbours) {
  for (const int samples : {1, 3, 8}) {
    const std::vector<double> pixels = rendered(samples);
    for (const int size : {4, 8}) {
      SCOPED_TRACE(::testing::Message() << samples << " samples, squares of " << size);
      const auto ratio = [&](const std::vector<double>& means) {
        return size * size * variance(means) / variance(pixels);
      };
      const std::vector<double> tiles = square_means(pixels, size, 0);
      expect_better_than_independent(ratio(tiles), tiles.size());
      // Squares across the tiles' borders gain less, but they do not lose.
      const std::vector<double> across = square_means(pixels, size, size / 2);
      EXPECT_LT(ratio(across), 1 + 3 * std::sqrt(2.0 / static_cast<double>(across.size() - 1)));
    }
  }
}

}  // namespace previz::test::sampling_test
