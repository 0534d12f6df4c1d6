// Tests which edges of a model a camera sees, and in which of them light is looked for.
#include "daemon/core/fit/visible_edges.hpp"

#include "daemon/core/fit/light_edge.hpp"
#include "tests/support/real_bodies.hpp"

namespace previz::visible_edges_test {

using fit::Segment;
using test::RealScene;

const auto cube = test::box(test::cube_low, test::cube_size);

std::vector<Segment> segments(const RealScene& real) {
  return visible_segments(real.model(), test::camera_of_tests().intrinsics,
                          test::place_of_camera());
}
std::vector<Segment> pieces(const RealScene& real) {
  return measurable_pieces(real.model(), test::camera_of_tests().intrinsics,
                           test::place_of_camera());
}

double length_of(const std::vector<Segment>& all) {
  double sum = 0;
  for (const Segment& segment : all) sum += glm::distance(segment.a, segment.b);
  return sum;
}

double distance_to(const glm::dvec2& p, const glm::dvec2& a, const glm::dvec2& b) {
  const double share = glm::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
  return glm::distance(p, a + share * (b - a));
}

struct Line {
  glm::dvec2 a{0}, b{0};
};

// The edges of the cube that the camera sees: it is before it, to its right and above it.
std::vector<Line> edges_in_view() {
  std::vector<Line> lines;
  for (const auto& [a, b] : std::vector<std::pair<glm::dvec3, glm::dvec3>>{{{0, 0, 0}, {1, 0, 0}},
                                                                           {{1, 0, 0}, {1, 1, 0}},
                                                                           {{0, 0, 1}, {1, 0, 1}},
                                                                           {{1, 0, 1}, {1, 1, 1}},
                                                                           {{0, 1, 1}, {1, 1, 1}},
                                                                           {{0, 0, 1}, {0, 1, 1}},
                                                                           {{0, 0, 0}, {0, 0, 1}},
                                                                           {{1, 0, 0}, {1, 0, 1}},
                                                                           {{1, 1, 0}, {1, 1, 1}}})
    lines.push_back({test::shown(test::cube_low + a * test::cube_size),
                     test::shown(test::cube_low + b * test::cube_size)});
  return lines;
}

TEST(VisibleEdges, AreThoseThatTheModelDoesNotHide) {
  const auto lines = edges_in_view();
  const auto all = segments(RealScene({cube}));
  double expected = 0;
  for (const Line& line : lines) expected += glm::distance(line.a, line.b);
  // A hidden edge would add a ninth; either end of an edge may be cut by 4 px.
  EXPECT_NEAR(length_of(all), expected, 9 * 8);
  for (const Segment& segment : all) {
    EXPECT_LE(glm::distance(segment.a, segment.b), 40 + 1e-6);
    for (const glm::dvec2& p : {segment.a, segment.b, 0.5 * (segment.a + segment.b)}) {
      double nearest = 1e9;
      for (const Line& line : lines) nearest = std::min(nearest, distance_to(p, line.a, line.b));
      EXPECT_LT(nearest, 1e-3);
    }
  }
}

TEST(VisibleEdges, AreNoneBehindAWall) {
  RealScene real({cube});
  real.add(test::sheet({{{-9, -0.3, -9}, {9, -0.3, -9}, {9, -0.3, 9}, {-9, -0.3, 9}}}));
  EXPECT_TRUE(segments(real).empty());
  EXPECT_TRUE(pieces(real).empty());
  // Virtual objects hide nothing real.
  real.scene.instances[1].presence = scene::world_mixed;
  EXPECT_FALSE(segments(real).empty());
}

TEST(VisibleEdges, FollowTheLens) {
  PinholeIntrinsics lens = test::camera_of_tests().intrinsics;
  lens.k1 = -0.3;
  const auto model = RealScene({cube}).model();
  const auto bent = visible_segments(model, lens, test::place_of_camera());
  ASSERT_FALSE(bent.empty());
  for (const Segment& segment : bent) {
    double nearest = 1e9;
    for (const Line& line : edges_in_view())
      for (int i = 0; i <= 1000; ++i)
        if (const auto px = fit::pixel_of(lens, line.a + i / 1000. * (line.b - line.a)))
          nearest = std::min(nearest, glm::distance(*px, segment.a));
    EXPECT_LT(nearest, 0.5);
  }
}

TEST(VisibleEdges, OfWhatIsBehindTheCameraAreNone) {
  EXPECT_TRUE(segments(RealScene({test::box({0.4, -3, 0.8}, test::cube_size)})).empty());
}

TEST(MeasurablePieces, KeepClearOfCornersAndOtherEdges) {
  const auto lines = edges_in_view();
  const auto all = pieces(RealScene({cube}));
  EXPECT_GT(all.size(), 9u);
  for (const Segment& piece : all) {
    EXPECT_GE(glm::distance(piece.a, piece.b), 12 - 1e-6);
    EXPECT_LE(glm::distance(piece.a, piece.b), 40 + 1e-6);
    const glm::dvec2 middle = 0.5 * (piece.a + piece.b);
    int own = 0;
    for (const Line& line : lines) {
      const bool is_own = distance_to(middle, line.a, line.b) < 1e-3;
      own += is_own;
      for (const glm::dvec2& p : {piece.a, piece.b})
        EXPECT_TRUE(is_own || distance_to(p, line.a, line.b) > 8 - 2);  // samples are 4 px apart
    }
    EXPECT_EQ(own, 1);
  }
}

// The front edges of a board of 4 mm are 4 px apart: each may be taken for the other.
TEST(MeasurablePieces, LeaveOutTheEdgesOfAThinBoard) {
  const RealScene thin({test::box({-0.1, 0, 0.1}, {0.2, 0.2, 0.004})});
  const RealScene thick({test::box({-0.1, 0, 0.1}, {0.2, 0.2, 0.03})});
  EXPECT_FALSE(segments(thin).empty());
  EXPECT_LT(2 * pieces(thin).size(), pieces(thick).size());
}

TEST(MeasurablePieces, LeaveOutWhereTheModelStands) {
  const auto all = pieces(RealScene({cube, test::table()}));
  const auto lines = edges_in_view();
  EXPECT_FALSE(all.empty());
  for (const Segment& piece : all)
    for (const std::size_t bottom : {0u, 1u})
      EXPECT_GT(distance_to(0.5 * (piece.a + piece.b), lines[bottom].a, lines[bottom].b), 6);
}

}  // namespace previz::visible_edges_test
