#include "daemon/core/scene/placement.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_node_test {

using GltfNodes = GltfTest;

// Products of a few doubles of size 10: 1e-14 is some 5 roundings.
void expect_near(const glm::dmat4& given, const glm::dmat4& expected) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      EXPECT_NEAR(given[column][row], expected[column][row], 1e-14) << column << ", " << row;
}

glm::dvec3 world(const scene::Instance& instance, const glm::dvec3& point) {
  return glm::dvec3(instance.world_from_object * glm::dvec4(point, 1));
}

std::vector<std::string> names_in(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (const scene::Instance& instance : scene.instances) names.push_back(instance.name);
  return names;
}

TEST_F(GltfNodes, TurnsYUpIntoZUp) {
  gltf.root("a", gltf.triangle_mesh());
  const scene::Scene scene = load();
  EXPECT_EQ(world(scene.instances.at(0), {1, 2, 3}), glm::dvec3(1, -3, 2));
}

TEST_F(GltfNodes, MultipliesTheHierarchyAsComputedByHand) {
  const int mesh = gltf.triangle_mesh();
  const double half = std::sqrt(0.5);
  // Child: scale 2, then 90 degrees about glTF's Y (z to x), then move by (0, 0, 1).
  const int child = gltf.add("nodes", {{"name", "child"},
                                       {"mesh", mesh},
                                       {"scale", {2, 2, 2}},
                                       {"rotation", {0, half, 0, half}},
                                       {"translation", {0, 0, 1}}});
  // Parent: columns x to y, y to -x, z to z, moved by (10, 0, 0).
  gltf.root(
      "parent", -1,
      {{"matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1}}, {"children", {child}}});
  object.world_from_file[3] = {0, 0, 5, 1};
  const scene::Scene scene = load();
  ASSERT_THAT(names_in(scene), ElementsAre("child"));
  // x: (1,0,0) -> 2 (0,0,-1) -> (0,0,-2); y -> (0,2,0) -> (-2,0,0); z -> (2,0,0) -> (0,2,0);
  // origin (0,0,1) -> (10,0,1). Then (x, y, z) -> (x, -z, y), then up by 5.
  expect_near(scene.instances[0].world_from_object,
              {0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 10, -1, 5, 1});
}

// EXT_mesh_gpu_instancing: copies of a mesh, each placed within the node, which an animation may
// move.
TEST_F(GltfNodes, PlacesTheCopiesOfANode) {
  const double half = std::sqrt(0.5);
  const int translations = gltf.positions({{1, 0, 0}, {0, 3, 0}});
  const int scales = gltf.positions({{2, 2, 2}, {1, 1, 1}});
  const int rotations =
      gltf.values<glm::vec4>(5126, "VEC4", {{0, 0, 0, 1}, {0, 0, float(half), float(half)}});
  gltf.root("trees", gltf.triangle_mesh(), {{"translation", {0, 0, 5}}});
  Json& copies = gltf.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  copies = {{"TRANSLATION", translations}, {"ROTATION", rotations}, {"SCALE", scales}};
  gltf.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  animate(0, "translation", {0, 1}, gltf.positions({{0, 0, 5}, {0, 0, 7}}));
  object.loops = false;
  scene::Scene scene = load();
  EXPECT_THAT(scene.notes, IsEmpty());
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.instances[0].mesh, scene.instances[1].mesh);
  // glTF's (x, y, z) is the world's (x, -z, y).
  EXPECT_EQ(world(scene.instances[0], {1, 0, 0}), glm::dvec3(3, -5, 0));
  EXPECT_NEAR(glm::distance(world(scene.instances[1], {1, 0, 0}), {0, -5, 4}), 0, 1e-6);
  scene.instances = scene::place(scene, {}, state_at(1)).instances;
  EXPECT_EQ(world(scene.instances[0], {1, 0, 0}), glm::dvec3(3, -7, 0));
  EXPECT_NEAR(glm::distance(world(scene.instances[1], {1, 0, 0}), {0, -7, 4}), 0, 1e-6);
  copies["SCALE"] = gltf.positions({{1, 1, 1}});
  EXPECT_THAT(error(), HasSubstr("its copies: their attributes have different numbers"));
}

TEST_F(GltfNodes, KeepsMirroredTransformsAndTheFrontOfTheObject) {
  gltf.root("mirrored", gltf.triangle_mesh(), {{"scale", {-1, 1, 1}}});
  const scene::Scene scene = load();
  const scene::Instance& instance = scene.instances.at(0);
  const scene::Mesh& mesh = scene.meshes.at(0);
  EXPECT_LT(glm::determinant(instance.world_from_object), 0);
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, 1));
  // scene.hpp's two ways to the world's geometric normal agree: glTF's +Z is the world's -Y.
  const glm::dvec3 by_transpose = glm::normalize(
      glm::transpose(glm::inverse(glm::dmat3(instance.world_from_object))) * mesh.normals[0]);
  const auto corner = [&](int i) { return world(instance, mesh.positions[mesh.triangles[0][i]]); };
  const glm::dvec3 by_cross =
      -glm::normalize(glm::cross(corner(1) - corner(0), corner(2) - corner(0)));
  EXPECT_EQ(by_transpose, glm::dvec3(0, -1, 0));
  EXPECT_EQ(by_cross, glm::dvec3(0, -1, 0));
}

TEST_F(GltfNodes, KeepsPositionsInDoublePrecision) {
  gltf.root("far", gltf.triangle_mesh(), {{"translation", {1000.0000001, 0, 0}}});
  EXPECT_EQ(load().instances.at(0).world_from_object[3].x, 1000.0000001);
}

TEST_F(GltfNodes, TakesTheDefaultSceneElseTheFirstElseAllRoots) {
  const int mesh = gltf.triangle_mesh();
  const int child = gltf.add("nodes", {{"name", "child"}, {"mesh", mesh}});
  const int a = gltf.add("nodes", {{"name", "a"}, {"mesh", mesh}, {"children", {child}}});
  const int b = gltf.add("nodes", {{"name", "b"}, {"mesh", mesh}});
  const auto names = [&] { return names_in(load()); };
  EXPECT_THAT(names(), ElementsAre("a", "child", "b"));
  gltf.json["scenes"] = {{{"nodes", {b}}}, {{"nodes", {a}}}};
  EXPECT_THAT(names(), ElementsAre("b"));
  EXPECT_THAT(load().notes, Contains(HasSubstr("has 2 scenes; only scene 0 is used")));
  gltf.json["scene"] = 1;
  EXPECT_THAT(names(), ElementsAre("a", "child"));
  gltf.json["scene"] = 2;
  EXPECT_THAT(error(), HasSubstr("its default scene 2 does not exist"));
}

TEST_F(GltfNodes, FiltersByNameWithWhatHangsBelow) {
  const int mesh = gltf.triangle_mesh();
  const int leaf = gltf.add("nodes", {{"name", "leaf"}, {"mesh", mesh}});
  const int inner = gltf.add(
      "nodes",
      {{"name", "inner"}, {"mesh", mesh}, {"translation", {0, 0, 1}}, {"children", {leaf}}});
  gltf.root("outer", mesh, {{"children", {inner}}, {"translation", {1, 0, 0}}});
  gltf.root("other", mesh);
  object.nodes = {"inner", "other"};
  const scene::Scene scene = load();
  ASSERT_THAT(names_in(scene), ElementsAre("inner", "leaf", "other"));
  EXPECT_EQ(world(scene.instances[1], {0, 0, 0}), glm::dvec3(1, -1, 0));  // outer's too
  object.nodes = {"iner"};
  EXPECT_EQ(error(),
            (directory / "test.gltf").string() + ": has no node \"iner\"; did you mean \"inner\"?");
}

// KHR_node_visibility: what is hidden is not there, with all that hangs below; its lamps neither.
TEST_F(GltfNodes, LeavesOutWhatTheFileHides) {
  const Json hidden = {{"KHR_node_visibility", {{"visible", false}}}};
  const Json shown = {{"KHR_node_visibility", {{"visible", true}}}};
  const int mesh = gltf.triangle_mesh();
  gltf.json["extensions"]["KHR_lights_punctual"]["lights"] = R"([{"type": "point"}])"_json;
  Json lamp = hidden;
  lamp["KHR_lights_punctual"]["light"] = 0;
  const int child = gltf.add("nodes", {{"name", "child"}, {"mesh", mesh}, {"extensions", shown}});
  gltf.root("hidden", mesh, {{"children", {child}}, {"extensions", hidden}});
  gltf.root("lamp", -1, {{"extensions", lamp}});
  gltf.root("shown", mesh, {{"extensions", shown}});
  gltf.root("plain", mesh, {{"extensions", {{"KHR_node_visibility", Json::object()}}}});
  gltf.json["extensionsUsed"] = {"KHR_node_visibility", "KHR_lights_punctual"};
  for (const bool is_required : {false, true}) {
    if (is_required) gltf.json["extensionsRequired"] = {"KHR_node_visibility"};
    const scene::Scene scene = load();
    EXPECT_THAT(names_in(scene), ElementsAre("shown", "plain"));
    EXPECT_THAT(scene.lights, IsEmpty());
    EXPECT_THAT(scene.notes, IsEmpty());
  }
  gltf.json["nodes"][3]["extensions"]["KHR_node_visibility"]["visible"] = "no";
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("its \"visible\" is neither true nor false")));
}

TEST_F(GltfNodes, ShowsAHiddenNodeThatTheObjectNames) {
  const Json hidden = {{"KHR_node_visibility", {{"visible", false}}}};
  const int mesh = gltf.triangle_mesh();
  const int inner = gltf.add("nodes", {{"name", "inner"}, {"mesh", mesh}, {"extensions", hidden}});
  const int child = gltf.add("nodes", {{"name", "child"}, {"mesh", mesh}, {"children", {inner}}});
  gltf.root("hidden", mesh, {{"children", {child}}, {"extensions", hidden}});
  object.nodes = {"child"};  // hidden by its parent
  const scene::Scene scene = load();
  EXPECT_THAT(names_in(scene), ElementsAre("child"));
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("node 1 \"child\": is hidden by the file")));
  object.nodes = {"hidden", "inner"};
  EXPECT_THAT(names_in(load()), ElementsAre("hidden", "child", "inner"));
}

TEST_F(GltfNodes, OfPhantomsArePrintedTagsByTheirNameOrAnAncestors) {
  const int child = gltf.add("nodes", {{"name", "Plane.002"}, {"mesh", gltf.triangle_mesh()}});
  gltf.root("tag 4", -1, {{"children", {child}}});
  gltf.root("under tag 4", gltf.triangle_mesh());
  gltf.root("table", gltf.triangle_mesh());
  object.presence = set::Presence::phantom;
  const scene::Scene real = load();
  ASSERT_EQ(real.instances.size(), 3u);
  const auto has = [&](std::size_t i, scene::TagPart part, int id, std::uint32_t presence) {
    EXPECT_EQ(real.instances[i].tag, part) << i;
    EXPECT_EQ(real.instances[i].tag_id, id) << i;
    EXPECT_EQ(real.instances[i].presence, presence) << i;
  };
  has(0, scene::TagPart::printed, 4, scene::world_both);
  has(1, scene::TagPart::under, 4, 0);
  has(2, scene::TagPart::none, -1, scene::world_both);
  object.presence = set::Presence::virtual_object;
  for (const scene::Instance& instance : load().instances)
    EXPECT_EQ(instance.tag, scene::TagPart::none);
}

TEST_F(GltfNodes, RefusesWhatIsNoTree) {
  const int mesh = gltf.triangle_mesh();
  gltf.root("a", mesh, {{"children", {1}}});
  gltf.root("b", mesh);
  EXPECT_THAT(error(), HasSubstr("node 1 \"b\" has two parents or is its own ancestor"));
  gltf.json["scenes"][0]["nodes"] = {0};
  expect_refused({{"/nodes/1/children", {0}, "has two parents or is its own ancestor"},
                  {"/nodes/1/children", {7}, "no node 7"},
                  {"/nodes/1/matrix", {1, 2, 3}, "node 1 \"b\": its transform has 3 numbers"}});
}

TEST_F(GltfNodes, SkipsSingularTransformsWithANote) {
  const int mesh = gltf.triangle_mesh();
  gltf.root("flat", mesh, {{"scale", {1, 0, 1}}});
  gltf.root("tiny", mesh, {{"scale", {1e-6, 1e-6, 1e-6}}});  // small, but not singular
  const scene::Scene scene = load();
  EXPECT_THAT(names_in(scene), ElementsAre("tiny"));
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("\"flat\": its transform is singular")));
}

TEST_F(GltfNodes, LoadsADeepChainOfNodes) {
  const int mesh = gltf.triangle_mesh();
  const int depth = 20000;
  for (int i = 0; i < depth; ++i) {
    Json node = {{"translation", {0, 0.5, 0}}};
    if (i > 0) node["children"] = {i - 1};
    gltf.add("nodes", std::move(node));
  }
  gltf.json["nodes"][0]["mesh"] = mesh;
  gltf.json["scenes"][0]["nodes"] = {depth - 1};
  EXPECT_EQ(load().instances.at(0).world_from_object[3].z, 0.5 * depth);
}

TEST_F(GltfNodes, PutsLightsIntoTheWorld) {
  const double half = std::sqrt(0.5);
  gltf.json["extensionsUsed"] = {"KHR_lights_punctual"};
  gltf.json["extensions"]["KHR_lights_punctual"]["lights"] = R"([
    {"type": "point", "color": [1, 0.5, 0.25], "intensity": 8},
    {"type": "directional", "name": "sun"},
    {"type": "spot", "range": 3, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
    {"type": "torch"}])"_json;
  gltf.root("lamp", -1, {{"translation", {1, 2, 3}}});
  // -90 degrees about X turns -Z to -Y: straight down.
  gltf.root("sun node", -1, {{"rotation", {-half, 0, 0, half}}, {"scale", {3, 3, 3}}});
  gltf.root("spot");
  gltf.root("torch");
  for (int i = 0; i < 4; ++i)
    gltf.json["nodes"][i]["extensions"]["KHR_lights_punctual"]["light"] = i;
  set::Light of_set;
  of_set.name = "of the set";
  a_set.lights = {of_set};
  const scene::Scene scene = load();
  ASSERT_EQ(scene.lights.size(), 4u);
  EXPECT_EQ(scene.lights[0].name, "lamp");
  EXPECT_EQ(scene.lights[0].type, set::LightType::point);
  EXPECT_EQ(scene.lights[0].position, glm::dvec3(1, -3, 2));
  EXPECT_EQ(scene.lights[0].emission, glm::dvec3(8, 4, 2));
  EXPECT_EQ(scene.lights[0].gain_mixed, 1);
  EXPECT_EQ(scene.lights[0].gain_real, 0);
  EXPECT_EQ(scene.lights[1].name, "sun");
  EXPECT_EQ(scene.lights[1].type, set::LightType::directional);
  EXPECT_NEAR(glm::distance(scene.lights[1].direction, {0, 0, -1}), 0, 1e-14);
  EXPECT_EQ(scene.lights[1].emission, glm::dvec3(1));
  EXPECT_EQ(scene.lights[2].type, set::LightType::spot);
  EXPECT_EQ(scene.lights[2].direction, glm::dvec3(0, 1, 0));
  EXPECT_FLOAT_EQ(static_cast<float>(scene.lights[2].inner_cone_rad), 0.2f);
  EXPECT_FLOAT_EQ(static_cast<float>(scene.lights[2].outer_cone_rad), 0.5f);
  EXPECT_EQ(scene.lights[3].name, "of the set");
  EXPECT_THAT(scene.notes, Contains(HasSubstr("range is ignored")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("unknown type \"torch\"")));

  object.presence = set::Presence::phantom;
  EXPECT_EQ(load().lights[0].gain_real, 1);
  object.presence = set::Presence::removed;
  EXPECT_EQ(load().lights[0].gain_mixed, 0);
  EXPECT_EQ(load().lights[0].gain_real, 1);
  gltf.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 4;
  EXPECT_THAT(error(), HasSubstr("node 0 \"lamp\": no light 4"));
}

}  // namespace previz::test::gltf_node_test
