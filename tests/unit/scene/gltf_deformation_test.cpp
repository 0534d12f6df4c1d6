// Skins and morph targets as glTF files have them: what a mesh is at rest, how an animation shapes
// it, what is refused.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/scene/bvh_refit.hpp"
#include "daemon/core/scene/gltf.hpp"
#include "daemon/core/scene/placement.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_deformation_test {

using namespace scene;

constexpr int floats = 5126, bytes = 5121;

// A triangle in glTF's space: two corners at the foot, and a tip.
const std::vector<glm::vec3> corners = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};

class GltfDeformations : public GltfTest {
 protected:
  int vec4s(const std::vector<glm::vec4>& values) { return gltf.values(floats, "VEC4", values); }

  // Node 0 has the mesh and stands at x = 7, where a skin must not care; node 1 is the foot's joint
  // and node 2, 2 m above it, the tip's.
  void skinned() {
    const std::vector<unsigned char> joints = {0, 9, 9, 9, 0, 9, 9, 9, 0, 1, 9, 9};
    const Json given = {{"POSITION", gltf.positions(corners)},
                        {"NORMAL", gltf.normals({{0, 0, 1}, {0, 0, 1}, {0, 0, 1}})},
                        {"JOINTS_0", gltf.accessor(gltf.view(joints), bytes, "VEC4", 3)},
                        {"WEIGHTS_0", vec4s({{1, 0, 0, 0}, {2, 0, 0, 0}, {0.25f, 0.75f, 0, 0}})}};
    const int inverse = gltf.values<glm::mat4>(
        floats, "MAT4", {glm::mat4(1), glm::translate(glm::mat4(1), glm::vec3(0, -2, 0))});
    gltf.root("figure", gltf.mesh({{"attributes", given}}),
              {{"translation", {7, 0, 0}}, {"skin", 0}});
    gltf.root("foot", -1, {{"children", {2}}});
    gltf.add("nodes", {{"name", "tip"}, {"translation", {0, 2, 0}}});
    gltf.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", inverse}}};
  }

  Json& attributes() { return first_primitive()["attributes"]; }

  // Moves the tip by 4 m along glTF's X within 2 s.
  void bow() {
    animate(2, "translation", {0, 2}, gltf.positions({{0, 2, 0}, {4, 2, 0}}));
    object.loops = false;
  }

  // A mesh with two targets: the first lifts the tip by 1 m, the second moves everything along X.
  void morphed() {
    const int lift = gltf.positions({{0, 0, 0}, {0, 0, 0}, {0, 1, 0}});
    const int shift = gltf.positions({{1, 0, 0}, {1, 0, 0}, {1, 0, 0}});
    gltf.root("face", gltf.mesh({{"attributes", {{"POSITION", gltf.positions(corners)}}},
                                 {"targets", {{{"POSITION", lift}}, {{"POSITION", shift}}}}}));
  }
  void smile() {
    animate(0, "weights", {0, 1}, gltf.values<float>(floats, "SCALAR", {0, 0, 1, 0.5f}));
    object.loops = false;
  }

  // The only deforming mesh's vertices in the set's world at a time of the animation.
  std::vector<glm::dvec3> played(const Scene& scene, double time_s) {
    set::Set set;
    set.objects = {object};
    const Placement placement = place(scene, set, state_at(time_s));
    const Mesh& mesh = scene.meshes.at(scene.deformations.at(0).mesh);
    std::vector<glm::dvec3> result;
    for (const glm::vec3& p : deformed(mesh.undeformed, placement.shapes.at(0)).positions)
      result.emplace_back(placement.instances[scene.deformations[0].instance].world_from_object *
                          glm::dvec4(glm::dvec3(p), 1));
    return result;
  }
};

// glTF's (x, y, z) is the world's (x, -z, y).
TEST_F(GltfDeformations, ASkinIgnoresItsNodeAndFollowsItsJoints) {
  skinned();
  bow();
  object.world_from_file[3].y = 3;
  const Scene scene = load();
  EXPECT_THAT(scene.notes, IsEmpty());
  ASSERT_EQ(scene.deformations.size(), 1u);
  EXPECT_THAT(scene.animations.at(0).instances, IsEmpty());
  EXPECT_EQ(scene.meshes[0].positions, corners);  // at rest, in the file's space
  std::vector<glm::dvec3> at = played(scene, 0);
  EXPECT_EQ(at[1], glm::dvec3(1, 3, 0));  // weights are made a sum of 1
  EXPECT_EQ(at[2], glm::dvec3(0, 3, 2));
  at = played(scene, 1);  // three quarters of 2 m
  EXPECT_NEAR(glm::distance(at[2], glm::dvec3(1.5, 3, 2)), 0, 1e-6);
  EXPECT_EQ(at[0], glm::dvec3(0, 3, 0));
}

TEST_F(GltfDeformations, WithoutAnAnimationTheShapeAtRestIsForGood) {
  skinned();
  gltf.json["nodes"][2]["translation"] = {0, 3, 0};  // the tip's joint is 1 m above its bind pose
  const Scene scene = load();
  EXPECT_THAT(scene.deformations, IsEmpty());
  EXPECT_TRUE(scene.meshes[0].undeformed.is_empty());
  EXPECT_EQ(scene.meshes[0].positions[2], glm::vec3(0, 2.75f, 0));
}

TEST_F(GltfDeformations, MorphTargetsAreAddedByTheirWeights) {
  morphed();
  smile();
  gltf.json["meshes"][0]["weights"] = {0.5, 0};
  const Scene scene = load();
  EXPECT_THAT(scene.notes, IsEmpty());
  ASSERT_EQ(scene.deformations.size(), 1u);
  EXPECT_EQ(scene.meshes[0].positions[2], glm::vec3(0, 2.5f, 0));
  EXPECT_TRUE(scene.meshes[0].undeformed.flat);
  EXPECT_NEAR(glm::distance(played(scene, 0.5)[2], glm::dvec3(0.25, 0, 2.5)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(played(scene, 9)[0], glm::dvec3(0.5, 0, 0)), 0, 1e-6);
}

// A target of no weight that nothing animates costs nothing; the node's weights stand before the
// mesh's.
TEST_F(GltfDeformations, WeightsAtRestAreTheNodesOrTheMeshs) {
  morphed();
  EXPECT_TRUE(load().meshes[0].undeformed.is_empty());
  gltf.json["meshes"][0]["weights"] = {1, 0};
  EXPECT_EQ(load().meshes[0].positions[2], glm::vec3(0, 3, 0));
  gltf.json["nodes"][0]["weights"] = {0, 2};
  EXPECT_EQ(load().meshes[0].positions[2], glm::vec3(2, 2, 0));
}

// Both objects are of one file, and each bends by itself.
TEST_F(GltfDeformations, EveryInstanceHasAShapeOfItsOwn) {
  skinned();
  bow();
  set::Object other = object;
  other.name = "still";
  other.animation.clear();
  other.file = directory / "test.gltf";
  a_set.objects = {other};
  const Scene scene = load();
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_NE(scene.instances[0].mesh, scene.instances[1].mesh);
  EXPECT_EQ(scene.deformations.size(), 1u);
}

TEST_F(GltfDeformations, CubicWeightsAreHermites) {
  // x = t^3 over 0 to 2 s, whose slope is 3 t^2.
  const WeightChannel cubic{Interpolation::cubic_spline, {0, 2}, {0, 0, 0, 12, 8, 12}};
  EXPECT_NEAR(weights_at(cubic, 1, 1)[0], 1, 1e-12);
  const WeightChannel step{Interpolation::step, {0, 2}, {1, 5, 3, 7}};
  EXPECT_EQ(weights_at(step, 2, 1.9), (std::vector<double>{1, 5}));
  EXPECT_EQ(weights_at(step, 2, 3), (std::vector<double>{3, 7}));
}

// A shape that is not finite, or is past what single precision holds, hides its instance, as a
// flattened one is hidden, and the placement says so. That holds for joints that no vertex follows
// as well, because all of them are uploaded.
TEST_F(GltfDeformations, AShapeThatCannotBeShownIsNotSeen) {
  skinned();
  bow();
  gltf.json["skins"][0]["joints"].push_back(1);
  gltf.json["skins"][0].erase("inverseBindMatrices");
  const Scene sound = load();
  const session::SceneState state = state_at(1);
  EXPECT_EQ(place(sound, {}, state).instances[0].presence, sound.instances[0].presence);
  EXPECT_THAT(place(sound, {}, state).unknown, IsEmpty());
  for (const double far : {HUGE_VAL, 1e300, 1e18}) {
    for (const std::size_t joint : {1, 2}) {
      Scene scene = sound;
      scene.deformations[0].joints[joint].joint_from_mesh[3].x = far;
      const Placement placement = place(scene, {}, state);
      EXPECT_EQ(placement.instances[0].presence, 0u) << far;
      EXPECT_THAT(placement.unknown, Contains(HasSubstr("\"figure\" cannot be shown")));
    }
  }
}

// Every number may be shown, but not what it makes of a tip that is 2 m high.
TEST_F(GltfDeformations, AShapeThatReachesTooFarIsNotSeen) {
  skinned();
  bow();
  Scene scene = load();
  scene.deformations[0].joints[1].joint_from_mesh[1].y = 9e14;
  const session::SceneState state = state_at(1);
  const Placement placement = place(scene, {}, state);
  EXPECT_EQ(placement.instances[0].presence, 0u);
  EXPECT_THAT(placement.unknown, Contains(HasSubstr("\"figure\" cannot be shown")));
}

// A joint may be anywhere if the weights of its vertices make up for it, but the bounds of the mesh
// are made of the joints alone.
TEST_F(GltfDeformations, ABoundPastAllNumbersIsRefusedAtRest) {
  skinned();
  bow();
  gltf.json["nodes"][1]["translation"] = {1e20, 0, 0};
  gltf.json["nodes"][2]["translation"] = {-1e20, 2, 0};
  const std::vector<unsigned char> both = {0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0};
  attributes()["JOINTS_0"] = gltf.accessor(gltf.view(both), bytes, "VEC4", 3);
  attributes()["WEIGHTS_0"] = vec4s({{1e-12f, 1, 0, 0}, {1e-12f, 1, 0, 0}, {1e-12f, 1, 0, 0}});
  EXPECT_THAT(error(), HasSubstr("beyond 1e15 at rest"));
}

// A few bytes can ask for as many vertices as an accessor without data may have, times as many
// targets or sets of joints as one likes.
TEST_F(GltfDeformations, TargetsAndSetsAreCountedBeforeTheyAreRead) {
  const char* words = "more than 67108864 vertices of morph targets and sets of joints";
  const std::size_t vertices = 1u << 22;
  const int zeros = gltf.accessor(-1, floats, "VEC3", vertices);
  const int zeros4 = gltf.accessor(-1, floats, "VEC4", vertices);
  Json primitive = {{"attributes", {{"POSITION", zeros}, {"NORMAL", zeros}}},
                    {"indices", gltf.indices({0, 1, 2})}};
  for (int target = 0; target < 17; ++target) primitive["targets"].push_back({{"POSITION", 99}});
  gltf.root("face", gltf.mesh(primitive));
  gltf.json["meshes"][0]["weights"] = std::vector<double>(17, 1);
  EXPECT_THAT(error(), HasSubstr(words));

  gltf.json["meshes"][0].erase("weights");
  first_primitive().erase("targets");
  for (int set = 0; set < 17; ++set) {
    attributes()["JOINTS_" + std::to_string(set)] = zeros4;
    attributes()["WEIGHTS_" + std::to_string(set)] = 99;
  }
  gltf.json["skins"] = {{{"joints", {0}}}};
  gltf.json["nodes"][0]["skin"] = 0;
  EXPECT_THAT(error(), HasSubstr(words));
}

TEST_F(GltfDeformations, JointsAreCountedForEveryNodeThatHasThem) {
  skinned();
  gltf.json["skins"][0] = {{"joints", std::vector<int>(65535, 1)}};
  for (int node = 0; node < 17; ++node) gltf.root("copy", 0, {{"skin", 0}});
  EXPECT_THAT(error(), HasSubstr("more than 1048576 joints"));
}

// A skin places its mesh, so that all copies of the node would lie in one place.
TEST_F(GltfDeformations, OfASkinsCopiesOneIsKept) {
  skinned();
  gltf.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
      gltf.positions({{1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  gltf.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const Scene scene = load();
  EXPECT_EQ(scene.instances.size(), 1u);
  EXPECT_THAT(scene.notes,
              Contains(HasSubstr("a skin places its mesh; only one of its 3 copies is")));
}

TEST_F(GltfDeformations, AreRefusedWhereTheyMakeNoSense) {
  skinned();
  const int one_weight = vec4s({{1, 0, 0, 0}});
  const int weights = vec4s({{1, 0, 0, 0}, {0, 0, 0, 0}, {1, 0, 0, 0}});
  const std::string of_skin = "/skins/0/", primitive = "/meshes/0/primitives/0/";
  expect_refused({{"/nodes/0/skin", 4, "no skin 4"},
                  {of_skin + "joints", {1}, "follows joint 1, but there are 1"},
                  {of_skin + "joints", {1, 9}, "no node 9"},
                  {of_skin + "joints", {1, 2, 1}, "fewer inverse bind matrices"},
                  {of_skin + "inverseBindMatrices", 0, "4 by 4 floats"},
                  {primitive + "attributes/WEIGHTS_0", one_weight, "numbers of elements"}});
  attributes()["WEIGHTS_0"] = weights;
  EXPECT_THAT(load().notes, Contains(HasSubstr("1 vertices follow no joint")));

  gltf = {};
  morphed();
  smile();
  const Json first_target = first_primitive()["targets"][0];
  expect_refused({{"/meshes/0/weights", {1}, "1 weights for 2 morph targets"},
                  {primitive + "targets", Json::array({first_target}),
                   "4 numbers for 2 times and 1 morph targets"}});
}

// The primitive of a hit has 24 bits.
TEST(DeformingPairs, PastTheirNumberAreRefused) {
  Mesh mesh;
  mesh.name = "crowd";
  mesh.positions = mesh.undeformed.positions = corners;
  mesh.triangles.resize((1u << 24) + 1, {0, 1, 2});
  EXPECT_THROW(deforming_pairs(mesh), Error);
}

}  // namespace previz::test::gltf_deformation_test
