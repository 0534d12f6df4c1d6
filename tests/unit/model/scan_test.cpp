// Scans that are placed by points that are marked in pictures.
#include "daemon/tools/model/scans.hpp"

#include <fmt/format.h>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/scan_place.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/tracking_synthetic.hpp"
#include "tests/unit/model/marked_scene.hpp"
#include "tests/unit/model/scan_files.hpp"

namespace previz::test {
namespace {

// A lump above the table, with four marked spots.
class Scans : public testing::Test {
 protected:
  Scans() {
    scene_ = scene_of_a_table();
    parts_.file = folder_ / "model.toml";
    parts_.scans.push_back(
        {"lump", folder_ / "lump.obj", model::LengthUnit::mm, model::UpAxis::z, 0, {}});
    const std::array spots{0, 20, 60, 110};
    for (std::size_t i = 0; i < spots.size(); ++i) add_spot(fmt::format("spot {}", i), spots[i]);
  }

  glm::dvec3 in_world(const glm::vec3& p) const { return turn_ * glm::dvec3(p) + shift_; }

  void add_spot(const std::string& name, std::size_t vertex) {
    const glm::vec3 p = mesh_.positions[vertex];
    scene_.points[name] = in_world(p);
    parts_.scans[0].points.push_back({name, 1000.0 * glm::dvec3(p)});
  }

  // Marks, adjusts and places; what is reported is in report_.
  std::vector<model::NamedMesh> placed() {
    std::mt19937 random(1);
    parts_.pictures = scene_.pictures(random);
    const model::Views views = scene_.views(parts_, random);
    const model::Start start = model::first_guess(parts_, views, scene_.tags);
    EXPECT_THAT(start.layout.unused_points, IsEmpty());
    const model::Fit fit = model::adjust(parts_, views, start);
    std::ostringstream out;
    auto scans = model::place_scans(parts_, start.layout, fit.shape,
                                    model::read_scans(parts_, {}, out), out);
    report_ = out.str();
    return scans;
  }

  std::string refusal() {
    return error_of([&] { placed(); });
  }

  TemporaryDirectory folder_;
  MarkedScene scene_;
  model::Parts parts_;
  model::TriangleMesh mesh_ = lump(8);
  glm::dmat3 turn_ = tracking::rotation_by({0.2, -0.1, 1.1});
  glm::dvec3 shift_{0.1, 0.2, 0.15};
  std::string report_;
};

TEST_F(Scans, ArePlacedByTheirMarkedPoints) {
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  const auto scans = placed();
  ASSERT_EQ(scans.size(), 1u);
  EXPECT_EQ(scans[0].name, "lump");
  const model::ShadedMesh& mesh = scans[0].mesh;
  ASSERT_EQ(mesh.indices.size(), mesh_.indices.size());
  for (std::size_t i = 0; i < mesh.indices.size(); ++i)
    EXPECT_LT(glm::distance(glm::dvec3(mesh.positions[mesh.indices[i]]),
                            in_world(mesh_.positions[mesh_.indices[i]])),
              1e-6);
  EXPECT_THAT(report_,
              HasSubstr("scan lump: 4 points, rms 0.00 mm; they would fit best at 1.0000"));
  EXPECT_THAT(report_, HasSubstr("scan lump: 224 triangles, none removed"));
  EXPECT_THAT(report_, Not(HasSubstr("warning")));
}

TEST_F(Scans, BecomeNodesOfTheModel) {
  write_ply(folder_ / "lump.ply", mesh_);
  parts_.scans[0].file = folder_ / "lump.ply";
  parts_.scans[0].unit = model::LengthUnit::m;
  parts_.scans[0].error_m = 1e-3;
  for (model::ScanPoint& point : parts_.scans[0].points) point.at /= 1000.0;
  std::ofstream(folder_ / "model.glb", std::ios::binary) << model::glb_of(placed(), {});
  const scene::Scene scene = scene::load_scene(set::parse_set(
      "[set]\nname = \"x\"\n[[object]]\nname = \"o\"\nfile = \"model.glb\"\npresence = "
      "\"phantom\"\nnodes = [\"lump\"]\n",
      folder_ / "set.toml"));
  ASSERT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(scene.materials[0].name, "lump");
  EXPECT_EQ(scene.materials[0].base_color, glm::vec3(0.5));
  ASSERT_EQ(scene.meshes.size(), 1u);
  // Every vertex is one of the scan.
  for (const glm::vec3& vertex : scene.meshes[0].positions) {
    const glm::dvec3 p(scene.instances.at(0).world_from_object * glm::dvec4(vertex, 1));
    double nearest = 1;
    for (const glm::vec3& truth : mesh_.positions)
      nearest = std::min(nearest, glm::distance(p, in_world(truth)));
    EXPECT_LT(nearest, 1e-6);
  }
}

TEST_F(Scans, AnotherUnitIsNamed) {
  write_obj(folder_ / "lump.obj", mesh_, 0.0254);
  for (model::ScanPoint& point : parts_.scans[0].points) point.at /= 25.4;
  EXPECT_THAT(refusal(), HasSubstr("scan \"lump\": the scan would have to be 25.4 times larger: is "
                                   "its unit \"in\"?"));
  parts_.scans[0].unit = model::LengthUnit::in;
  EXPECT_EQ(placed().size(), 1u);
}

TEST_F(Scans, UnitAndUpMustBeGivenSomewhere) {
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  parts_.scans[0].unit.reset();
  EXPECT_THAT(refusal(), HasSubstr("model.toml: scan \"lump\": unit is missing, and lump.obj does "
                                   "not give it; its points fit best with unit = \"mm\""));
  parts_.scans[0].up.reset();
  const std::string both = refusal();
  EXPECT_THAT(both, HasSubstr("unit = \"mm\""));
  EXPECT_THAT(both, HasSubstr("up = \"z\""));
}

TEST_F(Scans, AMirroredOneIsRefused) {
  for (model::ScanPoint& point : parts_.scans[0].points) point.at.x *= -1;
  for (glm::vec3& p : mesh_.positions) p.x *= -1;
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  EXPECT_THAT(refusal(), HasSubstr("mm if the scan is mirrored"));
}

TEST_F(Scans, APointThatContradictsTheOthersIsNamed) {
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  add_spot("spot 4", 77);
  scene_.points["spot 2"] += glm::dvec3(0, 0.012, 0.009);
  EXPECT_THAT(refusal(), HasSubstr("point \"spot 2\" is 15.0 mm from where the other points"));
}

TEST(ScanPlace, PointsOnOneLineAreRefused) {
  std::vector<model::PointPair> points{
      {"a", {0, 0, 0}, {1, 0, 0}}, {"b", {1, 2, 0.5}, {2, 2, 0.5}}, {"c", {2, 4, 1.01}, {3, 4, 1}}};
  EXPECT_THAT(error_of([&] { model::place_scan("statue", points, 1); }),
              HasSubstr("statue: its points \"a\", \"b\", \"c\" lie on one line in the scan"));
  points[2].in_scan = {2, 3, 4};
  EXPECT_THAT(error_of([&] { model::place_scan("statue", points, 1); }),
              HasSubstr("lie on one line in the pictures"));
  for (model::PointPair& pair : points) pair.in_scan = pair.in_world = {1, 1, 1};
  EXPECT_THAT(error_of([&] { model::place_scan("statue", points, 1); }), HasSubstr("on one line"));
}

// Two tags of 80 mm that are 3 m apart.
std::vector<model::PointPair> corners_of_two_tags() {
  std::vector<model::PointPair> points;
  for (const int tag : {1, 2})
    for (const glm::dvec2 corner : {glm::dvec2(0, 0), {0.08, 0}, {0.08, 0.08}, {0, 0.08}}) {
      const glm::dvec3 at(corner.x + 3 * (tag - 1), corner.y, 0);
      points.push_back({"corner", at, at, tag});
    }
  return points;
}

TEST(ScanPlace, TagsFarApartShowASmallError) {
  std::vector<model::PointPair> points = corners_of_two_tags();
  EXPECT_LT(model::place_scan("room", points, 1, 1e-3).rms_m, 1e-9);
  EXPECT_THAT(error_of([&] { model::place_scan("room", points, 1.06, 1e-3); }),
              HasSubstr("room: the scan would have to be 1.06 times smaller; correct its size"));
  for (std::size_t i = 4; i < 8; ++i)
    points[i].in_world = points[i].in_scan + glm::dvec3(0.08, 0, 0);
  EXPECT_THAT(error_of([&] { model::place_scan("room", points, 1, 1e-3); }),
              HasSubstr("or, if a tag was moved after the scan"));
}

// With noise of 1 mm in each coordinate, 4 points leave 12 - 6 of 12 degrees of freedom, so the
// root mean square of their distances is sqrt(3 * 6 / 12) mm on average over trials; its standard
// error over 400 trials, of a quantity that spreads by 1 / sqrt(2 * 6) of itself, is 1.5 %.
TEST(ScanPlace, TheDeviationIsThatOfTheNoise) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1e-3);
  const glm::dmat3 turn = tracking::rotation_by({0.3, 2, -1});
  double squares = 0;
  constexpr int trials = 400;
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<model::PointPair> points;
    for (const glm::dvec3 p : {glm::dvec3(0, 0, 0), {400, 0, 0}, {0, 300, 0}, {100, 50, 350}}) {
      glm::dvec3 off;
      for (glm::length_t k = 0; k < 3; ++k) off[k] = noise(random);
      points.push_back({"p", p, turn * (1e-3 * p) + glm::dvec3(1, 2, 3) + off});
    }
    const model::Placement placed = model::place_scan("scan", points, 1e-3);
    EXPECT_NEAR(glm::determinant(placed.rotation), 1, 1e-12);
    squares += placed.rms_m * placed.rms_m / trials;
  }
  EXPECT_NEAR(std::sqrt(squares), std::sqrt(1.5) * 1e-3, 4 * 0.015 * std::sqrt(1.5) * 1e-3);
}

// As a program shows them that has Y up turned to Z up, and another that shows metres.
TEST_F(Scans, PointsMustLieOnTheSurface) {
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  std::vector<model::ScanPoint>& points = parts_.scans[0].points;
  const auto right = points;
  for (model::ScanPoint& point : points) point.at = {point.at.x, -point.at.z, point.at.y};
  EXPECT_THAT(refusal(), HasSubstr("give its coordinates as the file has them"));
  points = right;
  for (model::ScanPoint& point : points) point.at *= 1e-3;
  EXPECT_THAT(refusal(), HasSubstr("units from the surface, whose diagonal has"));
}

// Three points fit the mirrored axes as well; that its up is not up shows it.
TEST_F(Scans, OneThatLiesOnItsSideIsWarnedOf) {
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  parts_.scans[0].up = model::UpAxis::x;
  placed();
  EXPECT_THAT(report_, HasSubstr("degrees from the vertical; check up"));
}

TEST_F(Scans, FaultsOfTheSurfaceAreReported) {
  mesh_.indices.resize(mesh_.indices.size() - 3);
  std::swap(mesh_.indices[0], mesh_.indices[1]);
  write_obj(folder_ / "lump.obj", mesh_, 1e-3);
  placed();
  EXPECT_THAT(report_, HasSubstr("warning: scan lump: 1 open borders, the longest"));
  EXPECT_THAT(report_, HasSubstr("1 faces turned"));
}

}  // namespace
}  // namespace previz::test
