// glTF animations: what keys mean between them (by hand), what is taken up, what is refused.
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>

#include "daemon/scene/animation.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test {
namespace scene_gltf_animation_test {

using ::testing::Contains;
using ::testing::HasSubstr;
using Json = GltfWriter::Json;
using namespace scene;

constexpr double rounding = 1e-14;

TEST(AnimationChannels, StepHoldsTheLastKey) {
  const AnimationChannel channel{
      Interpolation::step, {1, 2, 4}, {{1, 0, 0, 0}, {2, 0, 0, 0}, {3, 0, 0, 0}}};
  EXPECT_EQ(vector_at(channel, 0).x, 1);
  EXPECT_EQ(vector_at(channel, 1.999).x, 1);
  EXPECT_EQ(vector_at(channel, 2).x, 2);
  EXPECT_EQ(vector_at(channel, 9).x, 3);
}

TEST(AnimationChannels, LinearIsStraightBetweenKeysAndStaysOutside) {
  const AnimationChannel channel{Interpolation::linear, {1, 3}, {{1, 10, 0, 0}, {2, 20, 0, 0}}};
  EXPECT_EQ(vector_at(channel, 0.5), glm::dvec3(1, 10, 0));
  EXPECT_EQ(vector_at(channel, 1.5), glm::dvec3(1.25, 12.5, 0));
  EXPECT_EQ(vector_at(channel, 5), glm::dvec3(2, 20, 0));
}

// A cubic is its own Hermite spline: x = t^3 - 2 t over 1 s to 3 s, whose slope is 3 t^2 - 2.
TEST(AnimationChannels, CubicSplineIsHermites) {
  const auto x = [](double t) { return t * t * t - 2 * t; };
  const auto slope = [](double t) { return glm::dvec4(3 * t * t - 2, 0, 0, 0); };
  const AnimationChannel channel{
      Interpolation::cubic_spline,
      {1, 3},
      {slope(1), {x(1), 0, 0, 0}, slope(1), slope(3), {x(3), 0, 0, 0}, slope(3)}};
  for (const double t : {1.0, 1.25, 2.0, 2.875, 3.0})
    EXPECT_NEAR(vector_at(channel, t).x, x(t), 20 * rounding) << t;
  EXPECT_EQ(vector_at(channel, 7).x, x(3));
}

// Keys 0 and 270 degrees about Z; the second with the sign that says the long way.
TEST(AnimationChannels, RotationsTakeTheShorterWay) {
  const double half = 135 * std::numbers::pi / 180;
  const AnimationChannel channel{
      Interpolation::linear, {0, 1}, {{0, 0, 0, 1}, {0, 0, std::sin(half), std::cos(half)}}};
  const glm::dvec3 x = rotation_at(channel, 0.5) * glm::dvec3(1, 0, 0);
  EXPECT_NEAR(x.x, std::sqrt(0.5), rounding);
  EXPECT_NEAR(x.y, -std::sqrt(0.5), rounding);
}

class GltfAnimations : public GltfTest {
 protected:
  // An animation "go" of node 0 along glTF's Z, from 0 at 0 s to 2 at 4 s.
  void go(const Json& more_channels = Json::array()) {
    const int times = gltf.values<float>(5126, "SCALAR", {0, 4});
    const int places = gltf.positions({{0, 0, 0}, {0, 0, 2}});
    Json channels = {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}};
    for (const Json& channel : more_channels) channels.push_back(channel);
    gltf.json["animations"] = {{{"name", "go"},
                                {"channels", channels},
                                {"samplers", {{{"input", times}, {"output", places}}}}}};
    object.animation = "go";
  }
};

// Node 0 carries node 1, which has the mesh; node 2 stands still.
TEST_F(GltfAnimations, MoveWhatHangsBelowThem) {
  const int mesh = gltf.triangle_mesh();
  gltf.add("nodes", {{"children", {1}}});
  gltf.add("nodes", {{"mesh", mesh}, {"translation", {1, 0, 0}}});
  gltf.add("nodes", {{"mesh", mesh}});
  go();
  object.world_from_file[3].z = 5;
  const Scene loaded = load();
  ASSERT_EQ(loaded.animations.size(), 1u);
  const Animation& animation = loaded.animations[0];
  EXPECT_EQ(animation.duration_s, 4);
  ASSERT_EQ(animation.instances.size(), 1u);
  const Animation::Use use = animation.instances[0];
  EXPECT_EQ(world_from_nodes_at_rest(animation)[use.node],
            loaded.instances[use.what].world_from_object);
  // 1 s: half a metre along glTF's Z, which is the world's -Y.
  EXPECT_EQ(world_from_nodes(animation, 1)[use.node][3], glm::dvec4(1, -0.5, 5, 1));
  EXPECT_EQ(world_from_nodes(animation, 9)[use.node][3], glm::dvec4(1, -0.5, 5, 1));  // again
}

TEST_F(GltfAnimations, StayAtTheirEndWhereTheyDoNotLoop) {
  gltf.root("a", gltf.triangle_mesh());
  go();
  object.loops = false;
  const Scene loaded = load();
  EXPECT_EQ(world_from_nodes(loaded.animations.at(0), 9)[0][3], glm::dvec4(0, -2, 0, 1));
}

TEST_F(GltfAnimations, OfWhatGltfDoesNotNameAreNotedAndNotPlayed) {
  gltf.root("a", gltf.triangle_mesh());
  go({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "pointer"}}}}});
  EXPECT_THAT(load().notes, Contains(HasSubstr("its channels of \"pointer\" are not played")));
}

TEST_F(GltfAnimations, AreRefusedWhereTheyMakeNoSense) {
  gltf.root("a", gltf.triangle_mesh());
  go();
  const auto refusal = [&](const Json& changed) {
    gltf.json["animations"][0].merge_patch(changed);
    std::string message = error();
    go();
    return message;
  };
  object.animation = "goo";
  EXPECT_THAT(error(), HasSubstr("has no animation \"goo\"; did you mean \"go\"?"));
  go();
  EXPECT_THAT(refusal({{"samplers", {{{"input", 0}, {"output", 0}}}}}), HasSubstr("components"));
  EXPECT_THAT(
      refusal({{"channels", {{{"sampler", 7}, {"target", {{"node", 0}, {"path", "scale"}}}}}}}),
      HasSubstr("there is no sampler 7"));
  EXPECT_THAT(
      refusal({{"channels", {{{"sampler", 0}, {"target", {{"node", 9}, {"path", "scale"}}}}}}}),
      HasSubstr("there is no node 9"));
  gltf.json["nodes"].push_back({{"children", {2}}});
  gltf.json["nodes"].push_back({{"children", {1}}});
  EXPECT_THAT(error(), HasSubstr("is its own ancestor"));
  gltf.json["nodes"][2]["children"] = {0};
  gltf.json["nodes"][1]["children"] = {0};
  EXPECT_THAT(error(), HasSubstr("has two parents"));
  gltf.json["nodes"][2].erase("children");
  gltf.json["nodes"][1].erase("children");
  const int backwards = gltf.values<float>(5126, "SCALAR", {1, 0});
  Json samplers = gltf.json["animations"][0]["samplers"];
  samplers[0]["input"] = backwards;
  EXPECT_THAT(refusal({{"samplers", samplers}}), HasSubstr("not increasing"));
  const int three = gltf.values<float>(5126, "SCALAR", {0, 1, 2});
  samplers[0]["input"] = three;
  EXPECT_THAT(refusal({{"samplers", samplers}}), HasSubstr("has 2 values"));
  samplers[0]["interpolation"] = "BEZIER";
  EXPECT_THAT(refusal({{"samplers", samplers}}), HasSubstr("BEZIER"));
  gltf.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  EXPECT_THAT(error(), HasSubstr("has a matrix"));
}

}  // namespace scene_gltf_animation_test
}  // namespace previz::test
