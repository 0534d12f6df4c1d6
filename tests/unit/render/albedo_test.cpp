// The tables of directional albedo against an independent quadrature.
#include "daemon/core/render/world/albedo_table.hpp"
#include "shaders/lib/render_shared.h"
#include "tests/support/test.hpp"
#include "tests/truth/cpu_albedo.hpp"

namespace previz::render::albedo_test {

// Reads a table as the shader does, at a column and a row from 0 to 1.
double interpolate(const AlbedoTable& tables, double across, double down, std::size_t table = 0) {
  const double last = gpu::ALBEDO_SIDE - 1.0;
  const double x = across * last, y = down * last;
  const double column = std::min(std::floor(x), last - 1), row = std::min(std::floor(y), last - 1);
  const std::size_t first = table * gpu::ALBEDO_SIDE * gpu::ALBEDO_SIDE;
  const auto at = [&](double r, double c) -> double {
    return tables[first + static_cast<std::size_t>(r * gpu::ALBEDO_SIDE + c)];
  };
  const double fx = x - column, fy = y - row;
  return (1 - fy) * ((1 - fx) * at(row, column) + fx * at(row, column + 1)) +
         fy * ((1 - fx) * at(row + 1, column) + fx * at(row + 1, column + 1));
}

double look_up(const AlbedoTable& table, double cosine, double alpha) {
  return interpolate(table, std::sqrt(cosine), std::sqrt(alpha));
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

// The lobe of smooth sheen grows steep towards grazing, where its table is coarse: below roughness
// 0.1, or within 1 degree of the horizon, it may be 2 % off.
TEST(AlbedoTable, OfSheenInterpolatesWithinItsBound) {
  for (const double roughness : {0.08, 0.1, 0.13, 0.21, 0.37, 0.52, 0.71, 0.93}) {
    for (double cosine = 0.005; cosine <= 1; cosine *= 1.31) {
      const double share = truth::sheen_share(cosine, roughness);
      const double row =
          (roughness - gpu::LEAST_SHEEN_ROUGHNESS) / (1 - gpu::LEAST_SHEEN_ROUGHNESS);
      const bool is_coarse = roughness < 0.1 || cosine < 0.02;
      EXPECT_NEAR(interpolate(sheen_albedo(), std::sqrt(cosine), std::sqrt(row)), share,
                  is_coarse ? 0.02 * std::max(share, 1.0) : 4e-3)
          << "roughness " << roughness << " cosine " << cosine;
    }
  }
}

// Brushed metal as it is found, at the end of the scale, where facets along the brush strokes
// shadow each other most, and as narrow across them as the renderer makes a smooth one.
TEST(AlbedoTable, OfAnisotropyInterpolatesWithinItsBound) {
  struct Case {
    double strength, roughness, bound;
  };
  for (const Case& c : {Case{0.5, 0.2, 5e-3}, Case{0.65, 0.33, 5e-3}, Case{1, 0.5, 5e-3},
                        Case{1, 0.1, 1.5e-2}, Case{0.5, std::sqrt(1e-3), 1.5e-2}}) {
    const AlbedoTable tables = anisotropic_albedo(c.strength, c.roughness, c.roughness);
    ASSERT_EQ(tables.size(), gpu::ANISOTROPIC_TABLES * gpu::ALBEDO_SIDE * gpu::ALBEDO_SIDE);
    const double alpha = c.roughness * c.roughness;
    const double along = std::lerp(alpha, 1.0, c.strength * c.strength);
    for (double cosine = 0.1; cosine <= 1; cosine += 0.18) {
      for (double azimuth = 0.02; azimuth < 1.57; azimuth += 0.17) {
        const double sine = std::sqrt(1 - cosine * cosine);
        const glm::dvec3 o(sine * std::cos(azimuth), sine * std::sin(azimuth), cosine);
        const double at = std::sqrt(std::cos(azimuth)) * (gpu::ANISOTROPIC_TABLES - 1);
        const auto low = static_cast<std::size_t>(at);
        const double f = at - static_cast<double>(low);
        const auto read = [&](std::size_t table) {
          return interpolate(tables, std::sqrt(cosine), c.roughness, table);
        };
        EXPECT_NEAR(
            ((1 - f) * read(low) + f * read(low + 1)) / truth::anisotropic_share(o, {along, alpha}),
            1, c.bound)
            << "strength " << c.strength << " cosine " << cosine << " azimuth " << azimuth;
      }
    }
  }
}

// Without strength, it is the reflection's own table at any azimuth.
TEST(AlbedoTable, OfNoAnisotropyIsThatOfReflection) {
  const AlbedoTable tables = anisotropic_albedo(0, 0.2, 0.3);
  for (std::size_t table = 0; table < gpu::ANISOTROPIC_TABLES; table += 4)
    for (double cosine = 0.1; cosine <= 1; cosine += 0.15)
      EXPECT_NEAR(interpolate(tables, std::sqrt(cosine), 0.25, table),
                  interpolate(reflection_albedo(), std::sqrt(cosine), 0.25), 2e-3);
}

TEST(AlbedoTable, AMirrorLosesNothing) {
  const AlbedoTable& table = reflection_albedo();
  for (std::uint32_t column = 4; column < gpu::ALBEDO_SIDE; ++column)
    EXPECT_NEAR(table[column], 1, 1e-3);
}

}  // namespace previz::render::albedo_test
