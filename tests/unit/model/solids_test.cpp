// Closed geometry: nothing leaks where parts meet, and faces look outwards.
#include "daemon/tools/model/solids.hpp"

#include "tests/support/tracking_synthetic.hpp"
#include "tests/unit/model/marked_scene.hpp"

namespace previz::test {
namespace {

using Edge = std::pair<std::array<long, 3>, std::array<long, 3>>;

std::array<long, 3> key_of(const glm::dvec3& p) {
  return {std::lround(p.x * 1e7), std::lround(p.y * 1e7), std::lround(p.z * 1e7)};
}

// Every edge of a closed solid belongs to two faces, which go along it in opposite directions.
void expect_closed(const model::Solid& solid) {
  std::map<Edge, int> edges;
  for (const model::Face& face : solid.faces)
    for (std::size_t i = 0; i < face.outline.size(); ++i)
      ++edges[{key_of(face.outline[i]), key_of(face.outline[(i + 1) % face.outline.size()])}];
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << solid.name;
    EXPECT_TRUE(edges.contains({edge.second, edge.first})) << solid.name;
  }
}

// Six times the volume inside the faces; below 0 if they look inwards.
double volume_6(const model::Solid& solid) {
  double sum = 0;
  for (const model::Face& face : solid.faces)
    for (std::size_t i = 1; i + 1 < face.outline.size(); ++i)
      sum += glm::dot(face.outline[0], glm::cross(face.outline[i], face.outline[i + 1]));
  return sum;
}

struct Model {
  model::Parts parts;
  model::Layout layout;
  model::Shape shape;

  std::size_t add_plane(const std::string& name, model::Plane plane,
                        std::optional<std::size_t> on = {}) {
    parts.planes.push_back({.name = name, .margin_m = 1});
    layout.plane_on.push_back(on);
    shape.planes.push_back(plane);
    return shape.planes.size() - 1;
  }
};

TEST(ModelSolids, BoxesAndCylindersAreClosedAndLookOutwards) {
  Model m;
  const std::size_t table = m.add_plane("table", {{0, 0, 0.5}, {0, 0, 1}});
  m.parts.boxes.resize(2);
  m.shape.boxes = {{{0, 0, 0.5}, tracking::rotation_by({0, 0, 0.4}), {0.2, 0.3, 0.4}},
                   {{1, 0, 0.5}, glm::dmat3(1), {0.1, 0.1, 0.1}}};
  m.layout.box_on = {table, table};
  m.layout.is_clockwise = {false, true};
  m.parts.cylinders.resize(1);
  m.layout.cylinder_on = {table};
  m.shape.cylinders = {{{0.5, 0, 0.5}, {0, 0, 1}, 0.1, 0.3}};
  const auto solids = model::solids_of(m.parts, m.layout, m.shape);
  ASSERT_EQ(solids.size(), 4u);
  for (const std::size_t i : {1, 2, 3}) expect_closed(solids[i]);
  EXPECT_NEAR(volume_6(solids[1]) / 6, 0.2 * 0.3 * 0.4, 1e-12);
  EXPECT_NEAR(volume_6(solids[2]) / 6, 1e-3, 1e-12);
  // A polygon of 48 sides in the circle.
  EXPECT_NEAR(volume_6(solids[3]) / 6, 0.5 * 48 * std::sin(2 * std::numbers::pi / 48) * 0.01 * 0.3,
              1e-12);
  EXPECT_EQ(model::normal_of(solids[0].faces[0]), glm::dvec3(0, 0, 1));
}

TEST(ModelSolids, SidesAreNamedByTheCornersAsTheyAreMarked) {
  Model m;
  const std::size_t table = m.add_plane("table", {});
  m.parts.boxes.resize(1);
  m.shape.boxes = {{{0, 0, 0}, glm::dmat3(1), {1, 1, 1}}};
  m.layout.box_on = {table};
  m.layout.is_clockwise = {true};
  const auto box = model::solids_of(m.parts, m.layout, m.shape)[1];
  // Seen from above the corners go 1, 4, 3, 2 counter-clockwise: the first side counted so is 1-4.
  EXPECT_EQ(box.faces[2].name, "side 1-4");
  EXPECT_EQ(box.faces[5].name, "side 1-2");
}

TEST(ModelSolids, AWallEndsAtItsFloorAndTheFloorAtTheWall) {
  Model m;
  const std::size_t floor = m.add_plane("floor", {{0, 0, 0}, {0, 0, 1}});
  m.add_plane("wall", {{0, 2, 0}, {0, -1, 0}}, floor);
  m.parts.planes[0].points = {"a"};
  m.parts.planes[1].points = {"b"};
  m.layout.places = {{"a", {}}, {"b", {model::Place::Kind::free, 1, 0}}};
  m.shape.points = {{0, 1.5, 0}, {0, 2, 1}};
  const auto solids = model::solids_of(m.parts, m.layout, m.shape);
  double farthest = -1, lowest = 1;
  for (const glm::dvec3& p : solids[0].faces[0].outline) farthest = std::max(farthest, p.y);
  for (const glm::dvec3& p : solids[1].faces[0].outline) lowest = std::min(lowest, p.z);
  EXPECT_NEAR(farthest, 2, 1e-12);
  EXPECT_NEAR(lowest, 0, 1e-12);
  EXPECT_LT(glm::distance(model::normal_of(solids[1].faces[0]), glm::dvec3(0, -1, 0)), 1e-12);
}

// A camera 2 m before a wall and 1 m above the floor, which looks level, sees half the wall's
// height above itself; of the wall's own points none is above its foot.
TEST(ModelSolids, AWallGoesUpToThePicturesTop) {
  Model m;
  const std::size_t floor = m.add_plane("floor", {{0, 0, 0}, {0, 0, 1}});
  m.add_plane("wall", {{0, 2, 0}, {0, -1, 0}}, floor);
  m.parts.planes[0].points = {"near"};
  m.parts.planes[1].points = {"left", "right"};
  m.layout.places = {{"near", {}},
                     {"left", {model::Place::Kind::free, 1, 0}},
                     {"right", {model::Place::Kind::free, 2, 0}}};
  m.shape.points = {{0, 1.5, 0}, {-1, 2, 0}, {1, 2, 0}};
  model::Views views;
  views.lens = plain_lens(640, 480, 500);
  model::MarkedView view;
  view.pose.pose.rotation =
      glm::transpose(glm::dmat3(glm::dvec3(1, 0, 0), glm::dvec3(0, 0, -1), glm::dvec3(0, 1, 0)));
  view.pose.pose.translation = -view.pose.pose.rotation * glm::dvec3(0, 0, 1);
  views.views = {view};
  const auto highest = [&](const model::Views* seen) {
    double z = -1;
    const auto solids = model::solids_of(m.parts, m.layout, m.shape, seen);
    for (const auto& p : solids[1].faces[0].outline) z = std::max(z, p.z);
    return z;
  };
  const double above = 2 * (views.lens.cy + 0.5) / views.lens.fy;
  EXPECT_NEAR(highest(&views), 1 + above + 1, 1e-9);  // and its margin
  EXPECT_NEAR(highest(nullptr), 1, 1e-12);
  m.parts.planes[1].height_m = 2.6;
  EXPECT_NEAR(highest(&views), 2.6, 1e-12);
  m.parts.planes[1].height_m.reset();
  // A screen that leaves some of the floor behind itself is no wall.
  m.parts.planes[0].points.emplace_back("far");
  m.layout.places["far"] = {model::Place::Kind::free, 3, 0};
  m.shape.points.emplace_back(0, 3, 0);
  EXPECT_NEAR(highest(&views), 1, 1e-12);
}

// A low screen in the middle of a table ends nothing of it.
TEST(ModelSolids, AScreenLeavesWhatIsBehindIt) {
  Model m;
  const std::size_t table = m.add_plane("table", {{0, 0, 0}, {0, 0, 1}});
  m.add_plane("screen", {{0, 1, 0}, {0, -1, 0}}, table);
  m.parts.planes[0].points = {"near", "far"};
  m.parts.planes[1].points = {"on screen"};
  m.layout.places = {{"near", {}},
                     {"far", {model::Place::Kind::free, 1, 0}},
                     {"on screen", {model::Place::Kind::free, 2, 0}}};
  m.shape.points = {{0, 0, 0}, {0, 2, 0}, {0, 1, 0.2}};
  const auto solids = model::solids_of(m.parts, m.layout, m.shape);
  double farthest = -1;
  for (const glm::dvec3& p : solids[0].faces[0].outline) farthest = std::max(farthest, p.y);
  EXPECT_NEAR(farthest, 3, 1e-12);  // and its margin
}

TEST(ModelSolids, WallsThatDoNotGoAroundAreRefused) {
  Model m;
  const std::size_t floor = m.add_plane("floor", {{0, 0, 0}, {0, 0, 1}});
  m.add_plane("n", {{0, 2, 0}, {0, -1, 0}}, floor);
  m.add_plane("e", {{3, 0, 0}, {-1, 0, 0}}, floor);
  m.add_plane("ne", {{2.5, 1.5, 0}, glm::normalize(glm::dvec3(-1, -1, 0))}, floor);
  m.add_plane("w", {{-3, 0, 0}, {1, 0, 0}}, floor);
  m.parts.rooms.push_back({"room", "floor", {"n", "e", "ne", "w"}, 2.5});
  EXPECT_THROW(model::solids_of(m.parts, m.layout, m.shape), Error);
}

TEST(ModelSolids, ARoomIsClosedAndLooksInwards) {
  for (const bool reversed : {false, true}) {
    Model m;
    const std::size_t floor = m.add_plane("floor", {{0, 0, -0.1}, {0, 0, 1}});
    m.add_plane("n", {{0, 2, 0}, {0, -1, 0}}, floor);
    m.add_plane("w", {{-3, 0, 0}, glm::normalize(glm::dvec3(1, 0.1, 0))}, floor);
    m.add_plane("s", {{0, -1, 0}, {0, 1, 0}}, floor);
    m.add_plane("e", {{3, 0, 0}, {-1, 0, 0}}, floor);
    std::vector<std::string> walls = {"n", "w", "s", "e"};
    if (reversed) std::ranges::reverse(walls);
    m.parts.rooms.push_back({"room", "floor", walls, 2.5});
    const auto solids = model::solids_of(m.parts, m.layout, m.shape);
    ASSERT_EQ(solids.size(), 1u);
    expect_closed(solids[0]);
    EXPECT_NEAR(-volume_6(solids[0]) / 6, 2.5 * 3 * (6 + 0.05),
                1e-6);  // the west wall leans by 0.1
    const auto north = std::ranges::find(solids[0].faces, "n", &model::Face::name);
    ASSERT_NE(north, solids[0].faces.end());
    EXPECT_LT(glm::distance(model::normal_of(*north), glm::dvec3(0, -1, 0)), 1e-12);
  }
}

TEST(ModelSolids, AnOutlineMustBeConvex) {
  Model m;
  m.add_plane("table", {});
  m.parts.planes[0].outline = {"a", "b", "c", "d"};
  for (std::size_t i = 0; i < 4; ++i)
    m.layout.places[m.parts.planes[0].outline[i]] = {model::Place::Kind::free, i, 0};
  m.shape.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  EXPECT_EQ(model::solids_of(m.parts, m.layout, m.shape)[0].faces[0].outline.size(), 4u);
  std::swap(m.shape.points[1], m.shape.points[2]);
  EXPECT_THROW(model::solids_of(m.parts, m.layout, m.shape), Error);
}

}  // namespace
}  // namespace previz::test
