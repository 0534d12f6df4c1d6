// The adjustment: right within the accuracy that it states, and clear about what it cannot know.
#include "daemon/tools/model/fit.hpp"

#include "daemon/tools/model/solids.hpp"
#include "tests/support/tracking_synthetic.hpp"
#include "tests/support/units.hpp"
#include "tests/unit/model/marked_scene.hpp"

namespace previz::test {
namespace {

model::Parts table() {
  model::Parts parts;
  parts.file = "model.toml";
  parts.planes.push_back({.name = "table", .tags = {0, 1, 2}, .tag_thickness_m = 0});
  return parts;
}

model::Parts table_with_crate() {
  model::Parts parts = table();
  model::BoxPart& box = parts.boxes.emplace_back();
  box.name = "crate ";
  box.on = "table";
  box.top = corners("crate ", 't');
  return parts;
}

// A box on the table that is known by the tags on it, but for its height.
model::BoxPart tagged_box(const std::vector<int>& tags, double length_m, double width_m) {
  model::BoxPart box;
  box.name = "cube";
  box.on = "table";
  box.tags = tags;
  box.tag_thickness_m = 0;
  box.length_m = length_m;
  box.width_m = width_m;
  return box;
}

// A tag of 4 cm.
set::Tag tag_at(int id, const glm::dvec3& right, const glm::dvec3& up, const glm::dvec3& centre) {
  set::Tag tag{id, 0.04, glm::dmat4(1)};
  tag.world_from_tag = {glm::dvec4(right, 0), glm::dvec4(up, 0),
                        glm::dvec4(glm::cross(right, up), 0), glm::dvec4(centre, 1)};
  return tag;
}

constexpr glm::dvec3 crate_foot(0.1, 0.2, 0), crate_size(0.2, 0.12, 0.09);

MarkedScene scene_of_a_crate() {
  MarkedScene scene = scene_of_a_table();
  add_box(scene, "crate ", crate_foot, crate_size, 0.5);
  return scene;
}

void expect_crate(const model::Box& box, double tolerance_m) {
  EXPECT_LT(glm::distance(box.foot, crate_foot), tolerance_m);
  for (glm::length_t k = 0; k < 3; ++k) EXPECT_NEAR(box.size[k], crate_size[k], tolerance_m);
  EXPECT_NEAR(std::atan2(box.axes[0].y, box.axes[0].x), 0.5, tolerance_m / 0.05);
}

TEST(ModelFit, FindsABoxOnATableByItsUpperCorners) {
  model::Parts parts = table_with_crate();
  expect_crate(fit_of(scene_of_a_crate(), parts).shape.boxes[0], 1e-7);
}

TEST(ModelFit, ThreeCornersAreEnough) {
  model::Parts parts = table_with_crate();
  parts.boxes[0].top[2] = "";
  expect_crate(fit_of(scene_of_a_crate(), parts).shape.boxes[0], 1e-7);
}

TEST(ModelFit, CornersMayGoRoundEitherWay) {
  model::Parts parts = table_with_crate();
  // The corners go the other way from the same first one, so that the first edge is across the
  // crate.
  std::swap(parts.boxes[0].top[1], parts.boxes[0].top[3]);
  parts.boxes[0].length_m = crate_size.y;
  expect_crate(fit_of(scene_of_a_crate(), parts).shape.boxes[0], 1e-7);
}

TEST(ModelFit, ABoxNeedNotStandOnAnything) {
  model::Parts parts = table_with_crate();
  parts.boxes[0].on = "";
  parts.boxes[0].bottom = corners("crate ", 'b');
  parts.boxes[0].bottom[3] = "";
  expect_crate(fit_of(scene_of_a_crate(), parts).shape.boxes[0], 1e-7);
  parts.boxes[0].bottom.clear();
  parts.boxes[0].height_m = crate_size.z;
  expect_crate(fit_of(scene_of_a_crate(), parts).shape.boxes[0], 1e-7);
}

// The root mean square of errors over the stated deviation is 1 for one corner, known to
// 1 / sqrt(2 * 60) = 9 % by 60 trials. For the worst of a side's four corners it lies between 1,
// where they move together, and 1.57, where they do not; for the centre of the top it is below 1.
TEST(ModelFit, StatesHowAccurateEachFaceIs) {
  MarkedScene scene = scene_of_a_crate();
  scene.mark_px = 1;
  scene.pose_m = 5e-4;
  model::Parts parts = table_with_crate();
  const model::Box truth{crate_foot, tracking::rotation_by({0, 0, 0.5}), crate_size};
  constexpr int trials = 60;
  std::map<std::string, double> squares;
  for (unsigned trial = 0; trial < trials; ++trial) {
    const model::Fit fit = fit_of(scene, parts, trial);
    for (const model::FaceAccuracy& face : fit.faces) {
      if (face.part != "crate " || face.face == "bottom") continue;
      EXPECT_GT(face.sigma_m, 1e-5);
      EXPECT_LT(face.sigma_m, 2e-3);
    }
    // The top's height above the table, by its centre.
    const double height = fit.shape.boxes[0].size.z - truth.size.z;
    const auto top = std::ranges::find_if(
        fit.faces, [](const auto& f) { return f.part == "crate " && f.face == "top"; });
    squares["top"] += std::pow(height / top->sigma_m, 2);
    // The sides, where they are worst: at one of their corners.
    for (const auto& [name, k] :
         {std::pair<std::string, std::size_t>{"side 1-2", 0}, {"side 3-4", 2}}) {
      double most = 0;
      const glm::dvec3 normal = (k == 0 ? -1.0 : 1.0) * truth.axes[1];
      for (const std::size_t c : {k, k + 1, k + 4, k + 5})
        most = std::max(
            most, std::abs(glm::dot(model::corner(fit.shape.boxes[0], c) - model::corner(truth, c),
                                    normal)));
      const auto side = std::ranges::find_if(fit.faces, [&, &wanted = name](const auto& f) {
        return f.part == "crate " && f.face == wanted;
      });
      ASSERT_NE(side, fit.faces.end());
      squares[name] += std::pow(most / side->sigma_m, 2);
    }
  }
  EXPECT_GT(std::sqrt(squares["top"] / trials), 0.4);
  EXPECT_LT(std::sqrt(squares["top"] / trials), 1.1);
  for (const char* side : {"side 1-2", "side 3-4"}) {
    EXPECT_GT(std::sqrt(squares[side] / trials), 0.75) << side;
    EXPECT_LT(std::sqrt(squares[side] / trials), 1.5) << side;
  }
}

TEST(ModelFit, FindsABoxByTheTagsOnIt) {
  MarkedScene scene = scene_of_a_table();
  const model::Box cube{{0.1, 0.2, 0}, tracking::rotation_by({0, 0, 0.3}), {0.1, 0.11, 0.12}};
  // A tag on its upper side and one on each of two that are next to each other.
  const glm::dvec3 x = cube.axes[0], y = cube.axes[1], z(0, 0, 1);
  scene.tags.push_back(tag_at(10, x, y, cube.foot + 0.12 * z));
  scene.tags.push_back(tag_at(11, x, z, cube.foot - 0.055 * y + 0.06 * z));
  scene.tags.push_back(tag_at(12, y, z, cube.foot + 0.05 * x + 0.06 * z));
  model::Parts parts = table();
  parts.boxes.push_back(tagged_box({10, 11, 12}, 0.1, 0.11));
  const model::Shape shape = fit_of(scene, parts).shape;
  for (std::size_t k = 0; k < 8; ++k)
    EXPECT_LT(glm::distance(model::corner(shape.boxes[0], k), model::corner(cube, k)), 1e-7);
}

// A tag on a side whose right points upwards, a hair out of the wall: what is level decides, and
// not the rounding of what is upright.
TEST(ModelFit, ATagOnItsSideTurnsNoBox) {
  for (const double lean : {-1e-3, 0.0, 1e-3}) {
    MarkedScene scene = scene_of_a_table();
    const model::Box cube{{0.1, 0.2, 0}, glm::dmat3(1), {0.08, 0.06, 0.12}};
    const auto stick_on = [&](int id, glm::dvec3 right, const glm::dvec3& out_of,
                              const glm::dvec3& centre) {
      right = glm::normalize(right + lean * out_of);
      const glm::dvec3 normal = glm::normalize(out_of - glm::dot(out_of, right) * right);
      scene.tags.push_back(tag_at(id, right, glm::cross(normal, right), centre));
    };
    const glm::dvec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    stick_on(10, z, -y, cube.foot - 0.03 * y + 0.06 * z);
    stick_on(11, x, z, cube.foot + 0.12 * z);
    stick_on(12, y, x, cube.foot + 0.04 * x + 0.06 * z);
    model::Parts parts = table();
    parts.boxes.push_back(tagged_box({10, 11, 12}, 0.08, 0.06));
    const model::Shape shape = fit_of(scene, parts).shape;
    for (std::size_t k = 0; k < 8; ++k) {
      double nearest = 1;
      for (std::size_t i = 0; i < 8; ++i)
        nearest = std::min(nearest,
                           glm::distance(model::corner(shape.boxes[0], k), model::corner(cube, i)));
      EXPECT_LT(nearest, 3e-4) << lean;  // the leaning tags are 0.04 mm off over their width
    }
  }
}

TEST(ModelFit, AKnownSizeStaysAsItIs) {
  MarkedScene scene = scene_of_a_table();
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), foot(0.1, 0.2, 0);
  scene.tags.push_back(tag_at(10, x, y, foot + 0.12 * z));
  scene.tags.push_back(tag_at(11, y, z, foot + 0.0415 * x + 0.06 * z));  // 83 mm apart
  scene.tags.push_back(tag_at(12, -y, z, foot - 0.0415 * x + 0.06 * z));
  scene.tags.push_back(tag_at(13, x, z, foot - 0.03 * y + 0.06 * z));
  model::Parts parts = table();
  parts.boxes.push_back(tagged_box({10, 11, 12, 13}, 0.08, 0.06));
  const model::Box found = fit_of(scene, parts).shape.boxes[0];
  EXPECT_EQ(found.size.x, 0.08);
  EXPECT_NEAR(found.foot.x, foot.x, 1e-6);
}

TEST(ModelFit, MarksThatAreWorseThanStatedAreSaid) {
  MarkedScene scene = scene_of_a_crate();
  scene.mark_px = 2;
  model::Parts parts = table_with_crate();
  double sum = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) sum += fit_of(scene, parts, seed).mark_factor;
  EXPECT_NEAR(sum / 10, 2, 0.35);  // 40 coordinates a trial: known to 11 %, to 4 % in the mean
}

TEST(ModelFit, FindsACylinderByPointsOnItsRim) {
  MarkedScene scene = scene_of_a_table();
  constexpr double radius = 0.04, height = 0.12;
  const glm::dvec3 foot(0.05, 0.25, 0);
  for (int i = 0; i < 6; ++i)
    scene.points["rim" + std::to_string(i)] =
        foot + glm::dvec3(radius * std::cos(1.0 * i), radius * std::sin(1.0 * i), height);
  model::Parts parts = table();
  model::CylinderPart can;
  can.name = "can";
  can.on = "table";
  for (int i = 0; i < 6; ++i) can.top.push_back("rim" + std::to_string(i));
  parts.cylinders.push_back(can);
  const model::Cylinder found = fit_of(scene, parts).shape.cylinders[0];
  EXPECT_LT(glm::distance(found.foot, foot), 1e-6);
  EXPECT_NEAR(found.radius, radius, 1e-6);
  EXPECT_NEAR(found.height, height, 1e-6);
}

TEST(ModelFit, AWallStandsUprightOnTheFloor) {
  MarkedScene scene = scene_of_a_table();
  scene.points = {{"a", {-0.4, 0.6, 0.1}}, {"b", {0.4, 0.5, 0.3}}};
  model::Parts parts = table();
  parts.planes.push_back({.name = "wall", .points = {"a", "b"}, .upright_on = "table"});
  const model::Plane wall = fit_of(scene, parts).shape.planes[1];
  EXPECT_NEAR(wall.normal.z, 0, 1e-7);
  for (const auto& [name, point] : scene.points)
    EXPECT_NEAR(glm::dot(point - wall.at, wall.normal), 0, 1e-6);
  EXPECT_LT(wall.normal.y, 0);  // towards the cameras
}

TEST(ModelFit, OnePictureOfAWallsFootIsEnough) {
  MarkedScene scene = scene_of_a_table();
  scene.points = {{"a", {-0.4, 0.6, 0}}, {"b", {0.4, 0.5, 0}}};
  model::Parts parts = table();
  parts.planes.push_back({.name = "wall", .upright_on = "table", .foot = {"a", "b"}});
  std::mt19937 random(1);
  parts.pictures = scene.pictures(random);
  for (std::size_t i = 1; i < parts.pictures.size(); ++i) parts.pictures[i].marks.clear();
  const model::Views views = scene.views(parts, random);
  const model::Plane wall =
      model::adjust(parts, views, model::first_guess(parts, views, scene.tags)).shape.planes[1];
  for (const auto& [name, point] : scene.points)
    EXPECT_NEAR(glm::dot(point - wall.at, wall.normal), 0, 1e-6);
  EXPECT_NEAR(wall.normal.z, 0, 1e-7);
}

TEST(ModelFit, ATableEndsAtItsEdges) {
  MarkedScene scene = scene_of_a_table();
  scene.points = {{"far a", {-0.3, 0.7, 0}}, {"far b", {0.5, 0.6, 0}}};
  model::Parts parts = table();
  parts.planes[0].edges = {{"far a", "far b"}};
  std::mt19937 random(1);
  parts.pictures = scene.pictures(random);
  // On the plane one picture of a point is enough.
  for (std::size_t i = 1; i < parts.pictures.size(); ++i) parts.pictures[i].marks.clear();
  const model::Views views = scene.views(parts, random);
  const model::Start start = model::first_guess(parts, views, scene.tags);
  const auto face =
      model::solids_of(parts, start.layout, model::adjust(parts, views, start).shape)[0].faces[0];
  const glm::dvec3 along = glm::normalize(glm::dvec3(0.8, -0.1, 0));
  double farthest = -1;
  for (const glm::dvec3& p : face.outline)
    farthest = std::max(farthest, glm::cross(along, p - glm::dvec3(-0.3, 0.7, 0)).z);
  EXPECT_NEAR(farthest, 0, 1e-6);
  EXPECT_GE(face.outline.size(), 4u);
}

// Returns the words with which adjusting is refused.
std::string fit_refusal(const MarkedScene& scene, const model::Parts& parts) {
  return error_of([&] { fit_of(scene, parts); });
}

TEST(ModelFit, MarksThatContradictEachOtherAreNamed) {
  MarkedScene scene = scene_of_a_crate();
  model::Parts parts = table_with_crate();
  std::mt19937 random(1);
  parts.pictures = scene.pictures(random);
  for (model::Mark& mark : parts.pictures[3].marks)
    if (mark.point == "crate t2") mark.px += glm::dvec2(30, -10);
  const model::Views views = scene.views(parts, random);
  EXPECT_THAT(
      error_of([&] { model::adjust(parts, views, model::first_guess(parts, views, scene.tags)); }),
      AllOf(HasSubstr("model.toml: point \"crate t2\" in 3 is"), HasSubstr("px from where")));
}

TEST(ModelFit, WhatCannotBeIsRefusedByName) {
  MarkedScene scene = scene_of_a_crate();
  {
    model::Parts parts = table();
    parts.planes[0].tags = {0, 77};
    EXPECT_THAT(fit_refusal(scene, parts), HasSubstr("tag 77 of \"table\" is not in the set"));
  }
  {
    model::Parts parts = table();
    for (const char* name : {"n", "e", "s", "w"})
      parts.planes.push_back(
          {.name = name, .points = {"crate t1", "crate t2"}, .upright_on = "table"});
    parts.rooms.push_back({"room", "table", {"n", "e", "s", "w"}, 2});
    EXPECT_THAT(fit_refusal(scene, parts),
                HasSubstr("its walls \"n\" and \"e\" follow each other but are parallel"));
  }
  {
    model::Parts parts = table_with_crate();
    std::swap(parts.boxes[0].top[1], parts.boxes[0].top[2]);  // not around, but across
    EXPECT_THAT(fit_refusal(scene, parts), HasSubstr("crate "));
  }
  {
    MarkedScene aside = scene;  // all from one place
    aside.cameras = {scene.cameras[0], scene.cameras[0]};
    model::Parts parts = table_with_crate();
    EXPECT_THAT(fit_refusal(aside, parts), HasSubstr("mark it in a picture from further aside"));
  }
}

}  // namespace
}  // namespace previz::test
