// The tables of directional albedo against an independent quadrature.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "daemon/render/albedo_table.hpp"
#include "shaders/lib/render_shared.h"
#include "tests/truth/cpu_albedo.hpp"

namespace previz::render {
namespace render_albedo_test {

// As the shader reads a table.
double look_up(const AlbedoTable& table, double cosine, double alpha) {
  const double last = gpu::ALBEDO_SIDE - 1.0;
  const double x = std::sqrt(cosine) * last, y = std::sqrt(alpha) * last;
  const double column = std::min(std::floor(x), last - 1), row = std::min(std::floor(y), last - 1);
  const auto at = [&](double r, double c) -> double {
    return table[static_cast<std::size_t>(r * gpu::ALBEDO_SIDE + c)];
  };
  const double fx = x - column, fy = y - row;
  return (1 - fy) * ((1 - fx) * at(row, column) + fx * at(row, column + 1)) +
         fy * ((1 - fx) * at(row + 1, column) + fx * at(row + 1, column + 1));
}

template <typename Share>
void expect_close(const AlbedoTable& table, const Share& share) {
  for (double roughness = 0.1; roughness <= 1; roughness += 0.0937)
    for (double cosine = 0.05; cosine <= 1; cosine += 0.0411)
      EXPECT_NEAR(
          look_up(table, cosine, roughness * roughness) / share(cosine, roughness * roughness), 1,
          2.5e-3)
          << "roughness " << roughness << " cosine " << cosine;
}

// Both quadratures and the reference's own interpolation are well below the bound, which is for the
// bilinear one.
TEST(AlbedoTable, InterpolatesWithinItsBound) {
  expect_close(reflection_albedo(), truth::reflected_share);
  for (const double ior : {1.1, 1.5, 2.5}) {
    for (const double eta : {ior, 1 / ior}) {
      SCOPED_TRACE(eta);
      expect_close(refraction_albedo(eta), [eta](double cosine, double alpha) {
        return truth::scattered_share(cosine, alpha, eta);
      });
    }
  }
}

TEST(AlbedoTable, AMirrorLosesNothing) {
  const AlbedoTable& table = reflection_albedo();
  for (std::uint32_t column = 4; column < gpu::ALBEDO_SIDE; ++column)
    EXPECT_NEAR(table[column], 1, 1e-3);
}

}  // namespace render_albedo_test
}  // namespace previz::render
