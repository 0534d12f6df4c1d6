// Tests which edges a body of triangles has.
#include "daemon/core/fit/feature_edges.hpp"

#include "tests/support/real_bodies.hpp"

namespace previz::feature_edges_test {

using fit::feature_edges;
using fit::FeatureEdge;

double length(const FeatureEdge& edge) {
  return glm::distance(edge.a, edge.b);
}

// Two sheets of 1 m that share a side and turn by an angle there.
std::vector<glm::dvec3> folded(double degrees) {
  const double turn = glm::radians(degrees);
  auto body = test::sheet({{{-1, 0, 0}, {0, 0, 0}, {0, 1, 0}, {-1, 1, 0}}});
  const glm::dvec3 far(std::cos(turn), 0, std::sin(turn));
  const auto second = test::sheet({{{0, 0, 0}, far, far + glm::dvec3(0, 1, 0), {0, 1, 0}}});
  body.insert(body.end(), second.begin(), second.end());
  return body;
}

TEST(FeatureEdges, OfABoxAreItsTwelve) {
  const auto edges = feature_edges(test::box({1, 2, 3}, {0.1, 0.2, 0.3}));
  ASSERT_EQ(edges.size(), 12u);
  double sum = 0;
  for (const FeatureEdge& edge : edges) {
    sum += length(edge);
    ASSERT_EQ(edge.into.size(), 2u);
    EXPECT_NEAR(glm::dot(edge.into[0], edge.into[1]), 0, 1e-9);
  }
  EXPECT_NEAR(sum, 4 * 0.6, 1e-9);
}

TEST(FeatureEdges, OfASheetInManyPiecesAreItsFourBorders) {
  std::vector<glm::dvec3> sheet;
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 7; ++x) {
      const auto cell = test::sheet({{{x, y, 0}, {x + 1, y, 0}, {x + 1, y + 1, 0}, {x, y + 1, 0}}});
      sheet.insert(sheet.end(), cell.begin(), cell.end());
    }
  const auto edges = feature_edges(sheet);
  ASSERT_EQ(edges.size(), 4u);
  for (const FeatureEdge& edge : edges) {
    EXPECT_EQ(edge.into.size(), 1u);
    EXPECT_TRUE(length(edge) == 5 || length(edge) == 7) << length(edge);
  }
}

// A sheet of two in one plane has the two long borders joined: a fold cuts them.
TEST(FeatureEdges, AreFoldsOfMoreThanThirtyDegrees) {
  EXPECT_EQ(feature_edges(folded(0)).size(), 4u);
  EXPECT_EQ(feature_edges(folded(25)).size(), 6u);
  EXPECT_EQ(feature_edges(folded(-25)).size(), 6u);
  EXPECT_EQ(feature_edges(folded(35)).size(), 7u);
  EXPECT_EQ(feature_edges(folded(-90)).size(), 7u);
}

TEST(FeatureEdges, OfASheetWithABackAreNoOthers) {
  auto sheet = folded(0);
  const std::size_t front = sheet.size();
  for (std::size_t i = 0; i < front; i += 3)
    for (const std::size_t k : {0u, 2u, 1u}) sheet.push_back(sheet[i + k]);
  EXPECT_EQ(feature_edges(sheet).size(), 4u);
}

// Corners that programs write a rounding error apart are one.
TEST(FeatureEdges, CornersThatAreAlmostOneAre) {
  auto body = test::box({0, 0, 0}, {1, 1, 1});
  for (std::size_t i = 0; i < body.size(); ++i) body[i] += 4e-6 * double(i % 3);
  EXPECT_EQ(feature_edges(body).size(), 12u);
}

TEST(FeatureEdges, OfNothingAreNone) {
  EXPECT_TRUE(feature_edges({}).empty());
  EXPECT_TRUE(feature_edges({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}).empty());  // it has no area
}

}  // namespace previz::feature_edges_test
