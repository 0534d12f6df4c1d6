// How far a model is off, in pictures that are drawn exactly.
#include "daemon/fit/figure.hpp"

#include "tests/support/real_bodies.hpp"

namespace previz::figure_test {

using fit::Figure;
using test::RealScene;

constexpr double table_light = 0.35;

// A picture of flat faces, each of which has a light, over a plain table.
Frame picture(const std::vector<std::pair<std::vector<glm::dvec3>, double>>& faces) {
  const PinholeIntrinsics lens = test::camera_of_tests().intrinsics;
  test::LinearPicture light{lens.width, lens.height, {}};
  light.value.assign(std::size_t(lens.width) * std::size_t(lens.height), table_light);
  for (const auto& [corners, value] : faces) {
    std::vector<glm::dvec2> outline;
    for (const glm::dvec3& corner : corners) outline.push_back(test::shown(corner));
    add_polygon(light, outline, value - table_light);
  }
  test::Sensor sensor;
  sensor.full_well_e = 30000;
  std::mt19937 random(1);
  return expose(light, sensor, random);
}

// The three faces of the cube that the camera sees.
Frame picture_of_cube() {
  const auto at = [](double x, double y, double z) {
    return test::cube_low + glm::dvec3(x, y, z) * test::cube_size;
  };
  return picture({{{at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)}, 0.15},
                  {{at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1)}, 0.55},
                  {{at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)}, 0.8}});
}

// A card a metre before the camera and parallel to its picture, on its corner; moved to the right
// by so many pixels. Of 1200 px/m, it is 424 px wide, and its edges lie at 45 degrees.
std::array<glm::dvec3, 4> card(double right_px) {
  const glm::dmat4 camera = test::place_of_camera();
  std::array<glm::dvec3, 4> corners;
  std::size_t i = 0;
  for (const glm::dvec2 at : {glm::dvec2(-1, 0), {0, 1}, {1, 0}, {0, -1}})
    corners[i++] = camera * glm::dvec4(0.2 * at.x + right_px / 1200, 0.2 * at.y, 1, 1);
  return corners;
}

Frame picture_of_card() {
  const auto corners = card(0);
  return picture({{{corners.begin(), corners.end()}, 0.7}});
}

Figure figure_of(const RealScene& real, const Frame& frame) {
  const fit::RealModel model = real.model();
  const ObserverCalibration camera = test::camera_of_tests();
  fit::Measurement measurement(model, camera);
  measurement.look(frame, test::place_of_camera());
  return measurement.figure();
}

// The standard error of one piece is about 0.01 px at this noise.
TEST(ModelFigure, IsNoughtWhereTheModelIs) {
  const RealScene real({test::box(test::cube_low, test::cube_size), test::table()});
  const Figure figure = figure_of(real, picture_of_cube());
  ASSERT_TRUE(figure.off) << figure.why;
  EXPECT_EQ(figure.frames, 1u);
  EXPECT_GT(figure.found, 20u);
  EXPECT_EQ(figure.found, figure.looked_at);
  EXPECT_LT(figure.off->median_px, 0.03);
  EXPECT_LT(figure.off->most_px, 0.1);
  EXPECT_EQ(figure.off->shift_px, 0);
}

// An edge at 45 degrees is off by the shift over the root of two.
TEST(ModelFigure, IsTheDistanceThatTheModelIsMoved) {
  for (const double off : {0.0, 1.0, 3.0, -3.0, 6.0}) {
    const Figure figure =
        figure_of(RealScene({test::sheet(card(off * std::sqrt(2)))}), picture_of_card());
    ASSERT_TRUE(figure.off) << figure.why;
    EXPECT_EQ(figure.found, figure.looked_at);
    EXPECT_NEAR(figure.off->median_px, std::abs(off), 0.03);
    EXPECT_NEAR(figure.off->most_px, std::abs(off), 0.1);
    // The shift is found to half a pixel, in the direction of either axis.
    EXPECT_NEAR(figure.off->shift_px, std::abs(off) * std::sqrt(2), 0.8);
  }
}

// A stripe of 10 px along most of an edge of the card. It begins so far outside the edge, or inside
// where the number is negative.
std::pair<std::vector<glm::dvec3>, double> stripe(std::size_t edge, double outside_px) {
  const auto corners = card(0);
  const glm::dvec3 &a = corners[edge], &b = corners[(edge + 1) % 4];
  const glm::dvec3 middle = 0.5 * (corners[0] + corners[2]);
  const glm::dvec3 px = glm::normalize(0.5 * (a + b) - middle) / 1200.0;
  const glm::dvec3 from = a + 0.15 * (b - a), to = a + 0.85 * (b - a);
  const double end_px = outside_px + (outside_px < 0 ? -10 : 10);
  // Lights are added: the card's is 0.35 above the table's.
  const double light = outside_px < 0 ? -0.3 : 0.05;
  return {{from + outside_px * px, to + outside_px * px, to + end_px * px, from + end_px * px},
          light};
}

// The model is 5 px beside the card, and 2 or 4 px beside a stripe. The stripes do not agree on a
// shift; the card's edges do.
TEST(ModelFigure, IsNotThatOfOtherEdgesNearby) {
  const auto drawn = card(0);
  const Frame frame = picture({{{drawn.begin(), drawn.end()}, 0.7},
                               stripe(0, 9),
                               stripe(1, -9),
                               stripe(2, -7),
                               stripe(3, 7)});
  const Figure figure = figure_of(RealScene({test::sheet(card(-5 * std::sqrt(2)))}), frame);
  ASSERT_TRUE(figure.off) << figure.why;
  EXPECT_NEAR(figure.off->median_px, 5, 0.05);
  EXPECT_NEAR(figure.off->most_px, 5, 0.1);
}

TEST(ModelFigure, IsOfAllFrames) {
  const fit::RealModel model = RealScene({test::sheet(card(0))}).model();
  const ObserverCalibration camera = test::camera_of_tests();
  fit::Measurement measurement(model, camera);
  const Frame frame = picture_of_card();
  measurement.look(frame, test::place_of_camera());
  const std::size_t once = measurement.figure().found;
  measurement.look(frame, test::place_of_camera());
  EXPECT_EQ(measurement.figure().found, 2 * once);
  EXPECT_EQ(measurement.figure().frames, 2u);
}

TEST(ModelFigure, SaysWhyThereIsNone) {
  Figure figure = figure_of(RealScene({test::table()}), picture_of_cube());
  EXPECT_FALSE(figure.off);
  EXPECT_EQ(figure.looked_at, 0u);
  EXPECT_EQ(figure.why, "the pictures show too few straight edges of the model");

  figure = figure_of(RealScene({test::sheet(card(0))}), picture({}));
  EXPECT_FALSE(figure.off);
  EXPECT_GT(figure.looked_at, fit::least_pieces);
  EXPECT_EQ(figure.found, 0u);
  EXPECT_EQ(figure.why, "the pictures have edges of light at too few of the model's");
}

}  // namespace previz::figure_test
