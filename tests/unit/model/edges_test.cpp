// The edges of a model in pictures that are drawn exactly: what the marks left open is found.
#include "daemon/tools/model/edges.hpp"

#include "tests/support/tracking_synthetic.hpp"
#include "tests/unit/model/marked_scene.hpp"

namespace previz::test {
namespace {

const model::Box crate{{0.1, 0.2, 0}, tracking::rotation_by({0, 0, 0.5}), {0.2, 0.12, 0.09}};

// The crate with a light of its own on each side, on a plain table.
FramePtr picture_of(const MarkedScene& scene, std::size_t camera, std::mt19937& random) {
  constexpr double table = 0.35;
  constexpr std::array lights = {0.0, 0.8, 0.15, 0.55, 0.22, 0.6};  // in the order of the faces
  model::Parts parts;
  parts.boxes.resize(1);
  parts.boxes[0].name = "crate";
  model::Layout layout;
  layout.box_on = {std::nullopt};
  layout.is_clockwise = {false};
  model::Shape shape;
  shape.boxes = {crate};
  const tracking::CameraFromWorld pose = tracking::camera_from_world(scene.cameras[camera]);
  LinearPicture picture{scene.lens.width, scene.lens.height, {}};
  picture.value.assign(std::size_t(picture.width) * std::size_t(picture.height), table);
  const model::Solid solid = model::solids_of(parts, layout, shape)[0];
  for (std::size_t f = 0; f < solid.faces.size(); ++f) {
    const glm::dvec3 eye(scene.cameras[camera][3]);
    if (glm::dot(eye - solid.faces[f].outline[0], model::normal_of(solid.faces[f])) <= 0) continue;
    std::vector<glm::dvec2> outline;
    for (const glm::dvec3& p : solid.faces[f].outline)
      outline.push_back(model::projected(scene.lens, pose.rotation * p + pose.translation));
    add_polygon(picture, outline, lights[f] - table);
  }
  Sensor sensor;
  sensor.full_well_e = 30000;
  return std::make_shared<const Frame>(expose(picture, sensor, random));
}

struct Drawn {
  MarkedScene scene = scene_of_a_table();
  model::Parts parts;
  model::Views views;
  model::Start start;

  explicit Drawn(unsigned seed) {
    add_box(scene, "c", crate.foot, crate.size, 0.5);
    scene.mark_px = 1;
    parts.planes.push_back({.name = "table", .tags = {0, 1, 2}, .tag_thickness_m = 0});
    parts.boxes.resize(1);
    parts.boxes[0].name = "crate";
    parts.boxes[0].on = "table";
    parts.boxes[0].top = corners("c", 't');
    std::mt19937 random(seed);
    parts.pictures = scene.pictures(random);
    views = scene.views(parts, random);
    for (std::size_t i = 0; i < views.views.size(); ++i)
      views.views[i].frame = picture_of(scene, i, random);
    start = model::first_guess(parts, views, scene.tags);
  }
};

double worst_corner(const model::Fit& fit) {
  double worst = 0;
  for (std::size_t k = 0; k < 8; ++k)
    worst = std::max(worst,
                     glm::distance(model::corner(fit.shape.boxes[0], k), model::corner(crate, k)));
  return worst;
}

TEST(ModelEdges, LeadFurtherThanMarks) {
  const ResponseCurve srgb;
  double by_marks = 0, by_edges = 0;
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Drawn drawn(seed);
    by_marks += worst_corner(model::adjust(drawn.parts, drawn.views, drawn.start));
    const model::Fit fit = model::adjust_to_edges(drawn.parts, drawn.views, drawn.start, srgb);
    by_edges += worst_corner(fit);
    EXPECT_GT(fit.edges_off_px.size(), 60u);
    for (const double off : fit.edges_off_px) EXPECT_LT(off, 0.3);
    // The corners are within three of the standard deviations that are stated of the worst face.
    double stated = 0;
    for (const model::FaceAccuracy& face : fit.faces)
      stated = std::max(stated, face.part == "crate" ? face.sigma_m : 0);
    EXPECT_LT(worst_corner(fit), 3 * std::sqrt(3) * stated);
  }
  EXPECT_LT(by_edges, 0.25 * by_marks);
}

// A wall that stands at the border of an outlined table cuts it or not, from step to step.
TEST(ModelEdges, OfAnOutlineThatAWallMayCutAreLeftOut) {
  Drawn drawn(5);
  drawn.scene.points["table a"] = {-0.6, -0.4, 0};
  drawn.scene.points["table b"] = {0.6, -0.4, 0};
  drawn.scene.points["table c"] = {0.6, 0.6, 0};
  drawn.scene.points["table d"] = {-0.6, 0.6, 0};
  for (const auto& outline : {std::vector<std::string>{"table a", "table b", "table c", "table d"},
                              {"table c", "table d", "table a", "table b"}}) {
    drawn.parts.planes.resize(1);
    drawn.parts.planes[0].outline = outline;
    drawn.parts.planes.push_back(
        {.name = "wall", .upright_on = "table", .foot = {"table c", "table d"}});
    std::mt19937 random(5);
    drawn.parts.pictures = drawn.scene.pictures(random);
    drawn.views = drawn.scene.views(drawn.parts, random);
    for (std::size_t i = 0; i < drawn.views.views.size(); ++i)
      drawn.views.views[i].frame = picture_of(drawn.scene, i, random);
    const model::Start start = model::first_guess(drawn.parts, drawn.views, drawn.scene.tags);
    EXPECT_LT(
        worst_corner(model::adjust_to_edges(drawn.parts, drawn.views, start, ResponseCurve{})),
        1e-3);
  }
}

// A paper beside the crate has a border that is brighter than any edge of the crate.
TEST(ModelEdges, BesideAPaperAreNotLookedFor) {
  const Drawn drawn(6);
  model::Start start = drawn.start;
  const auto count = [&] {
    return model::find_edges(drawn.parts, start.layout, drawn.views, start.shape, ResponseCurve{})
        .size();
  };
  start.shape.boxes = {crate};
  const std::size_t all = count();
  set::Tag beside = flat_tag(7, 0.08, {0, 0, 0}, 0.5);
  const glm::dvec3 side = crate.foot - (0.5 * crate.size.y + 0.052) * crate.axes[1];
  beside.world_from_tag[3] = glm::dvec4(side, 1);
  start.layout.tags.push_back({&beside, 0, 0});
  const std::size_t without_some = count();
  EXPECT_LT(without_some, all);
  EXPECT_GT(without_some, all / 2);
}

TEST(ModelEdges, AreThoseThatTheModelDoesNotHide) {
  const Drawn drawn(4);
  model::Start start = drawn.start;
  const auto pieces =
      model::find_edges(drawn.parts, start.layout, drawn.views,
                        model::adjust(drawn.parts, drawn.views, start).shape, ResponseCurve{});
  const auto solids = model::solids_of(drawn.parts, start.layout, start.shape);
  ASSERT_FALSE(pieces.empty());
  for (const model::EdgePiece& piece : pieces) {
    const model::Face& face = solids[piece.solid].faces[piece.face];
    EXPECT_EQ(solids[piece.solid].name, "crate");
    EXPECT_NE(face.name, "bottom");
    // One of the two faces that meet there looks at the camera.
    const glm::dvec3 eye(drawn.scene.cameras[piece.view][3]);
    const glm::dvec3 middle = 0.5 * (face.outline[piece.edge] + face.outline[(piece.edge + 1) % 4]);
    int seen = 0;
    for (const model::Face& other : solids[piece.solid].faces) {
      const bool has_it =
          std::abs(glm::dot(middle - other.outline[0], model::normal_of(other))) < 1e-6;
      seen += has_it && glm::dot(eye - middle, model::normal_of(other)) > 0;
    }
    EXPECT_GE(seen, 1);
  }
}

}  // namespace
}  // namespace previz::test
