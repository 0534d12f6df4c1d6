// Tests which parts of a scene are edges of the real world.
#include "tests/support/gltf_test.hpp"
#include "tests/support/real_bodies.hpp"

namespace previz::real_model_test {

using test::RealScene;

const auto cube = test::box(test::cube_low, test::cube_size);

TEST(RealModel, HasWhatIsRealAndStandsStill) {
  RealScene real({cube});
  EXPECT_EQ(real.model().edges().size(), 12u);

  real.scene.instances[0].presence = scene::world_real;  // removed
  EXPECT_EQ(real.model().edges().size(), 12u);
  real.scene.instances[0].presence = scene::world_mixed;  // virtual
  EXPECT_TRUE(real.model().edges().empty());

  real = RealScene({cube});
  real.set.objects[0].carrier = "cart";
  EXPECT_TRUE(real.model().edges().empty());
  real = RealScene({cube});
  real.set.objects[0].animation = "swing";
  EXPECT_TRUE(real.model().edges().empty());
}

TEST(RealModel, IsWhereItsInstancesAre) {
  RealScene real({cube});
  real.scene.instances[0].world_from_object[3] = {5, 6, 7, 1};
  const auto model = real.model();
  for (const fit::ModelEdge& edge : model.edges())
    EXPECT_LT(glm::distance(0.5 * (edge.a + edge.b), glm::dvec3(5, 6.1, 7.1)), 0.15);
}

TEST(RealModel, GlassAndCutOutsHideAndHaveNoEdges) {
  RealScene real({cube});
  real.scene.materials[0].transmission = 1;
  EXPECT_TRUE(real.model().edges().empty());
  EXPECT_FALSE(real.model().is_seen({0, -1, 0.1}, {0, 1, 0.1}));
  real.scene.materials[0] = {};
  real.scene.materials[0].alpha_mode = scene::AlphaMode::mask;
  EXPECT_TRUE(real.model().edges().empty());
}

TEST(RealModel, KnowsWhereAThingStandsOnAnother) {
  std::size_t touched = 0;
  const auto model = RealScene({cube, test::table()}).model();
  for (const fit::ModelEdge& edge : model.edges()) {
    const bool stands_there = edge.a.z < 0.01 && edge.b.z < 0.01 && std::abs(edge.a.x) < 1;
    EXPECT_EQ(edge.is_touched, stands_there) << edge.a.x << ' ' << edge.a.y << ' ' << edge.a.z;
    touched += edge.is_touched;
  }
  EXPECT_EQ(touched, 4u);
}

// Printed tags lie on parts, and are none: the crew does not measure their places by hand.
TEST(RealModel, NamesItsThingsAsTheSetAndItsFilesDo) {
  RealScene real({cube, test::table(), test::box({1, 0, 0}, test::cube_size),
                  test::box({2, 0, 0}, test::cube_size), test::box({3, 0, 0}, test::cube_size)});
  const std::vector<std::string> nodes = {"Cube.001", "table", "red cube", "Cube.001", "tag 3"};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    real.scene.instances[i].node = nodes[i];
    real.scene.instances[i].placed = static_cast<std::uint32_t>(i);
    real.scene.instances[i].object = i == 0 ? 0 : 1;
  }
  real.scene.instances[4].tag = scene::TagPart::printed;
  real.set.objects[0].name = "crate";
  real.set.objects[1].name = "set";
  const auto model = real.model();
  EXPECT_EQ(model.parts(), (std::vector<std::string>{"crate", "table", "red cube", "Cube.001"}));
  const std::vector<std::size_t> of_instances = {0, 1, 2, 3, fit::no_part};
  for (const fit::ModelEdge& edge : model.edges()) {
    const double x = 0.5 * (edge.a.x + edge.b.x);
    const bool is_of_table = std::max(std::abs(edge.a.x), std::abs(edge.b.x)) == 4;
    EXPECT_EQ(edge.part, is_of_table ? 1 : of_instances[x < 0.5 ? 0 : 1 + std::size_t(x + 0.2)])
        << x;
  }
}

TEST(RealModel, NamesOfItsThingsDiffer) {
  RealScene real({cube, cube, cube, cube, cube, cube, cube});
  const std::vector<std::string> nodes = {"lid", "box", "lid", "box", "lid", "", ""};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    real.scene.instances[i].node = nodes[i];
    real.scene.instances[i].placed = static_cast<std::uint32_t>(i);
    real.scene.instances[i].object = i < 2 ? 0 : 1;
  }
  real.set.objects[0].name = "left";
  real.set.objects[1].name = "right";
  EXPECT_EQ(real.model().parts(),
            (std::vector<std::string>{"left: lid", "left: box", "right: lid (1 of 2)", "right: box",
                                      "right: lid (2 of 2)", "right (1 of 2)", "right (2 of 2)"}));
}

class RealModelOfFile : public test::GltfTest {
 protected:
  // A box of two materials: three sides each.
  int crate() {
    auto triangles = test::box({0, 0, 0}, test::cube_size);
    const auto middle = triangles.begin() + std::ptrdiff_t(triangles.size() / 2);
    const auto primitive = [&](auto begin, auto end) {
      return Json{{"attributes", {{"POSITION", gltf.positions({begin, end})}}},
                  {"material", gltf.add("materials", Json::object())}};
    };
    const int mesh = gltf.mesh(primitive(triangles.begin(), middle));
    gltf.json["meshes"][std::size_t(mesh)]["primitives"].push_back(
        primitive(middle, triangles.end()));
    return mesh;
  }

  fit::RealModel model() {
    object.name = "props";
    object.presence = set::Presence::phantom;
    const scene::Scene scene = load();
    set::Set set;
    set.objects = {object};
    return {scene, set};
  }
};

TEST_F(RealModelOfFile, ANodeOfSeveralMaterialsIsOneThing) {
  const int mesh = crate();
  gltf.root("crate.1", mesh);
  gltf.root("", mesh, {{"translation", {1, 0, 0}}});
  gltf.root("", mesh, {{"translation", {2, 0, 0}}});
  const auto real = model();
  EXPECT_EQ(real.parts(),
            (std::vector<std::string>{"crate.1", "props (1 of 2)", "props (2 of 2)"}));
  EXPECT_EQ(real.edges().size(), 36u);
  for (const fit::ModelEdge& edge : real.edges())
    EXPECT_EQ(edge.part, std::size_t(0.5 * (edge.a.x + edge.b.x))) << edge.a.x << ' ' << edge.b.x;
}

TEST_F(RealModelOfFile, EveryCopyOfANodeIsAThing) {
  gltf.root("chair", crate());
  gltf.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", gltf.positions({{0, 0, 0}, {1, 0, 0}})}};
  const auto real = model();
  EXPECT_EQ(real.parts(),
            (std::vector<std::string>{"props: chair (1 of 2)", "props: chair (2 of 2)"}));
  for (const fit::ModelEdge& edge : real.edges())
    EXPECT_EQ(edge.part, std::size_t(0.5 * (edge.a.x + edge.b.x)));
}

// Where parts meet, neither's edge is its own; and what lies in one line is not one edge.
TEST(RealModel, EdgesOfTwoThingsAreOfNone) {
  const RealScene apart({test::sheet({{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}}),
                         test::sheet({{{1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}}})});
  std::size_t of_none = 0;
  const auto folded = apart.model();
  for (const fit::ModelEdge& edge : folded.edges()) of_none += edge.part == fit::no_part;
  EXPECT_EQ(folded.edges().size(), 7u);
  EXPECT_EQ(of_none, 1u);
  const RealScene in_line({test::sheet({{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}}),
                           test::sheet({{{1, 1, 0}, {2, 1, 0}, {2, 2, 0}, {1, 2, 0}}})});
  EXPECT_EQ(in_line.model().edges().size(), 8u);
}

TEST(RealModel, OfNothingHidesNothing) {
  const auto model = RealScene().model();
  EXPECT_TRUE(model.edges().empty());
  EXPECT_TRUE(model.is_seen({0, 0, 1}, {0, 0, 0}));
}

}  // namespace previz::real_model_test
