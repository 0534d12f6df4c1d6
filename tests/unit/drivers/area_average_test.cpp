#include "drivers/convert/area_average.hpp"

#include <gmock/gmock.h>

#include <glm/vec2.hpp>

namespace previz::test {

// Each pixel of 5 x 3 reaches over 2/5 x 1/3 of a pixel of 2 x 1: the middle column is shared.
TEST(AreaAverage, IsOfAreasOfAnyShape) {
  convert::AreaAverage<glm::dvec2> average(5, 3, 2, 1);
  std::vector<glm::dvec2> means;
  for (int y = 0; y < 3; ++y)
    average.add([&](int x) { return glm::dvec2(x, x * y); },
                [&](std::span<const glm::dvec2> row) { means.assign(row.begin(), row.end()); });
  ASSERT_EQ(means.size(), 2u);
  const double left = (0 + 1 + 0.5 * 2) / 2.5, right = (0.5 * 2 + 3 + 4) / 2.5;
  EXPECT_NEAR(glm::distance(means[0], glm::dvec2(left, left)), 0, 1e-15);
  EXPECT_NEAR(glm::distance(means[1], glm::dvec2(right, right)), 0, 1e-15);
}

// A column of 5 rows over 3: the second and the fourth row are shared, and each row is given once,
// as soon as the last of its parts is there.
TEST(AreaAverage, GivesARowWithItsLastPart) {
  convert::AreaAverage<double> average(1, 5, 1, 3);
  std::vector<std::pair<int, double>> given;
  for (int y = 0; y < 5; ++y)
    average.add([&](int) { return y; },
                [&](std::span<const double> row) { given.emplace_back(y, row[0]); });
  ASSERT_EQ(given.size(), 3u);
  const std::pair<int, double> expected[] = {
      {1, (0 + 1 * 2 / 3.0) / (5 / 3.0)}, {3, (1 / 3.0 + 2 + 3 / 3.0) / (5 / 3.0)}, {4, 3.6}};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(given[i].first, expected[i].first);
    EXPECT_NEAR(given[i].second, expected[i].second, 1e-15);
  }
}

}  // namespace previz::test
