// How far a model is off, in pictures that are drawn exactly.
#include "daemon/core/fit/figure.hpp"

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

// Boxes on a table, drawn exactly: the faces of a box that the camera sees are the front, the right
// and the top one.
struct Box {
  std::string name;
  glm::dvec3 low{0}, size{0};
};

std::vector<Box> boxes() {
  return {{"red", {-0.25, -0.05, 0}, {0.12, 0.12, 0.12}},
          {"green", {0, 0.15, 0}, {0.14, 0.12, 0.16}},
          {"blue", {0.12, -0.2, 0}, {0.12, 0.1, 0.1}}};
}

Frame picture_of(const std::vector<Box>& drawn) {
  std::vector<std::pair<std::vector<glm::dvec3>, double>> faces;
  for (const Box& box : drawn) {
    const auto at = [&](double x, double y, double z) {
      return box.low + glm::dvec3(x, y, z) * box.size;
    };
    faces.push_back({{at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)}, 0.15});
    faces.push_back({{at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1)}, 0.55});
    faces.push_back({{at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)}, 0.8});
  }
  return picture(faces);
}

RealScene model_of(const std::vector<Box>& modelled) {
  RealScene real;
  for (const Box& box : modelled) {
    real.add(test::box(box.low, box.size));
    real.set.objects.back().name = box.name;
  }
  real.add(test::table());
  real.set.objects.back().name = "table";
  return real;
}

// Returns a way on the table that the camera sees as so many pixels at a point.
glm::dvec3 way_of(double px, const glm::dvec3& at, const glm::dvec3& direction) {
  return px / glm::distance(test::shown(at + 1e-3 * direction), test::shown(at)) * 1e-3 * direction;
}

std::string names_of(const Figure& figure) {
  std::string names;
  for (const fit::PartOff& part : figure.things_off) names += part.name + ";";
  return names;
}

// The shift is found to a step of 0.5 px on either axis, so to 0.36 px; the near and the far end of
// a box of 0.16 m, seen from 1.1 m, differ by 15 %, the middle and an end by 0.4 px of 5.
TEST(ModelFigure, NamesTheThingThatWasMovedWhileTheRestFits) {
  const glm::dvec3 right(1, 0, 0), back(0, 1, 0), aslant(-0.6, 0.8, 0);
  const std::array<std::vector<glm::dvec3>, 3> directions = {
      {{right, back, aslant}, {right, back}, {back, aslant}}};
  for (std::size_t moved = 0; moved < 3; ++moved)
    for (const glm::dvec3& direction : directions[moved]) {
      auto drawn = boxes();
      Box& box = drawn[moved];
      box.low += way_of(5, box.low + 0.5 * box.size, direction);
      const Figure figure = figure_of(model_of(boxes()), picture_of(drawn));
      ASSERT_TRUE(figure.off) << figure.why;
      EXPECT_LT(figure.off->median_px, 0.3);
      ASSERT_EQ(names_of(figure), box.name + ";");
      EXPECT_NEAR(figure.things_off[0].shift_px, 5, 0.36 + 0.4);
      EXPECT_GE(figure.things_off[0].pieces, fit::least_pieces);
    }
}

TEST(ModelFigure, NamesTheWorstThingFirst) {
  auto drawn = boxes();
  drawn[0].low += way_of(4, drawn[0].low, {1, 0, 0});
  drawn[2].low += way_of(8, drawn[2].low, {0, 1, 0});
  drawn.push_back({"box", {-0.3, 0.3, 0}, {0.1, 0.1, 0.1}});
  auto modelled = boxes();
  modelled.push_back(drawn.back());
  EXPECT_EQ(names_of(figure_of(model_of(modelled), picture_of(drawn))), "blue;red;");
}

TEST(ModelFigure, NamesNothingWhereNothingWasMoved) {
  EXPECT_EQ(names_of(figure_of(model_of(boxes()), picture_of(boxes()))), "");
}

// 1.4 px is less than a viewer sees, with what the shift is found to.
TEST(ModelFigure, NamesNothingThatIsOffByLessThanAViewerSees) {
  auto drawn = boxes();
  drawn[1].low += way_of(1.4, drawn[1].low, {1, 0, 0});
  EXPECT_EQ(names_of(figure_of(model_of(boxes()), picture_of(drawn))), "");
}

TEST(ModelFigure, NamesNothingIfAllIsOff) {
  auto drawn = boxes();
  for (Box& box : drawn) box.low += way_of(5, {0, 0, 0}, {1, 0, 0});
  const Figure figure = figure_of(model_of(boxes()), picture_of(drawn));
  EXPECT_EQ(names_of(figure), "");
  EXPECT_GT(fit::off_px(figure), fit::most_off_px);
}

// A camera that is not where it is thought to be shows what is near by farther off than the rest.
TEST(ModelFigure, NamesNothingIfTheCameraIsElsewhere) {
  const fit::RealModel model = model_of(boxes()).model();
  const ObserverCalibration camera = test::camera_of_tests();
  const Frame frame = picture_of(boxes());
  for (const auto& [by_m, roll_deg] : {std::pair{glm::dvec3(8e-3, 0, 0), 0.0},
                                       {{0, 5e-3, 5e-3}, 0},
                                       {{0, 0, 0}, 0.5},
                                       {{0, 0, 0}, 1},
                                       {{0, 0, 0}, 2},
                                       {{0, 0, 0}, -1},
                                       {{2e-3, 0, 0}, 0.5}}) {
    glm::dmat4 pose = test::place_of_camera();
    const double turn = glm::radians(roll_deg);
    const glm::dvec4 x = pose[0], y = pose[1];
    pose[0] = std::cos(turn) * x + std::sin(turn) * y;
    pose[1] = std::cos(turn) * y - std::sin(turn) * x;
    pose[3] += glm::dvec4(by_m, 0);
    fit::Measurement measurement(model, camera);
    measurement.look(frame, pose);
    EXPECT_EQ(names_of(measurement.figure()), "") << by_m.x << ' ' << roll_deg;
  }
}

// Stripes at 6 px beside three of the four edges of a card, a box that fits, and a card that does:
// the card's own edges are there as well.
TEST(ModelFigure, NamesNothingForOtherEdgesNearby) {
  auto modelled = model_of(boxes());
  const auto drawn = card(0);
  modelled.add(test::sheet(drawn));
  const Frame frame = picture({{{drawn.begin(), drawn.end()}, 0.7},
                               stripe(0, 6),
                               stripe(1, 6),
                               stripe(2, -6),
                               stripe(3, -6)});
  EXPECT_EQ(names_of(figure_of(modelled, frame)), "");
}

Frame picture_with_red_moved() {
  auto drawn = boxes();
  drawn[0].low += way_of(5, drawn[0].low, {1, 0, 0});
  return picture_of(drawn);
}

// A part that is off in some frames is hidden there by somebody, or they are blurred.
TEST(ModelFigure, NamesWhatIsOffInMostFrames) {
  const fit::RealModel model = model_of(boxes()).model();
  const ObserverCalibration camera = test::camera_of_tests();
  const Frame still = picture_of(boxes()), moved = picture_with_red_moved();
  for (const int off : {2, 3, 4}) {
    fit::Measurement measurement(model, camera);
    for (int i = 0; i < 5; ++i) measurement.look(i < off ? moved : still, test::place_of_camera());
    EXPECT_EQ(names_of(measurement.figure()), off >= 4 ? "red;" : "") << off;
  }
}

// Somebody stands before it in the other frames.
TEST(ModelFigure, NamesNothingThatMostFramesDoNotShow) {
  const fit::RealModel model = model_of(boxes()).model();
  const ObserverCalibration camera = test::camera_of_tests();
  auto drawn = boxes();
  drawn.erase(drawn.begin());
  const Frame hidden = picture_of(drawn);
  fit::Measurement measurement(model, camera);
  measurement.look(picture_with_red_moved(), test::place_of_camera());
  EXPECT_EQ(names_of(measurement.figure()), "red;");
  for (int i = 0; i < 2; ++i) measurement.look(hidden, test::place_of_camera());
  EXPECT_EQ(names_of(measurement.figure()), "");
}

TEST(ModelFigure, NamesTheThingsThatAreNotJudged) {
  EXPECT_EQ(figure_of(model_of(boxes()), picture_of(boxes())).not_judged,
            std::vector<std::string>{"table"});
  auto drawn = boxes();
  drawn.erase(drawn.begin());
  auto modelled = boxes();
  modelled.push_back({"behind", {0.5, -2, 0}, {0.1, 0.1, 0.1}});
  EXPECT_EQ(figure_of(model_of(modelled), picture_of(drawn)).not_judged,
            (std::vector<std::string>{"red", "behind", "table"}));
}

// What was put back is off no more after so many frames.
TEST(ModelFigure, NamesThingsByTheLastFrames) {
  const fit::RealModel model = model_of(boxes()).model();
  const ObserverCalibration camera = test::camera_of_tests();
  const Frame still = picture_of(boxes()), moved = picture_with_red_moved();
  fit::Parts parts;
  const auto names_after = [&](const Frame& frame, std::size_t times) {
    fit::Measurement measurement(model, camera, parts);
    for (std::size_t i = 0; i < times; ++i) measurement.look(frame, test::place_of_camera());
    parts = measurement.parts();
    return names_of(measurement.figure());
  };
  EXPECT_EQ(names_after(moved, 1), "red;");
  EXPECT_EQ(names_after(still, fit::frames_judged), "");
  EXPECT_EQ(names_after(moved, fit::frames_judged), "red;");
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

// The pose of a picture may be a recorded one, so that nothing has read the picture before.
TEST(ModelFigure, IsNoneOfPicturesThatTheLensIsNotCalibratedFor) {
  Frame frame;
  frame.width = 320;
  frame.height = 240;
  frame.bytes.resize(frame_bytes(frame.format, frame.width, frame.height));
  const Figure figure = figure_of(model_of(boxes()), frame);
  EXPECT_FALSE(figure.off);
  EXPECT_EQ(figure.looked_at, 0u);
  EXPECT_EQ(figure.why,
            "the pictures have 320x240 pixels, and the lens is calibrated for 1280x960");
}

}  // namespace previz::figure_test
