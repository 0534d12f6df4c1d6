// glTF animations: what keys mean between them (by hand), what is taken up, what is refused.
#include <glm/gtc/quaternion.hpp>

#include "daemon/core/scene/animation.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_animation_test {

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
  // An animation of node `node` along glTF's Z, from 0 at 0 s to `end` at `duration_s`.
  Json movement(int node, float end, float duration_s) {
    return gltf.animation(node, "translation", {0, duration_s},
                          gltf.positions({{0, 0, 0}, {0, 0, end}}));
  }
  // An animation "go" of node 0 along glTF's Z, from 0 at 0 s to 2 at 4 s.
  void go() { animate(0, "translation", {0, 4}, gltf.positions({{0, 0, 0}, {0, 0, 2}})); }
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

// A session stores files by their checksums, and what to write into the set is the next question.
TEST_F(GltfAnimations, ThatAreNotPlayedAreNamedBesideTheFilesOwnName) {
  gltf.root("a", gltf.triangle_mesh());
  gltf.json["animations"] = {movement(0, 2, 1), movement(0, 2, 3)};
  gltf.json["animations"][1]["name"] = "sway";
  object.file_as_written = "models/plant.glb";
  EXPECT_THAT(load().notes,
              Contains(AllOf(StartsWith("models/plant.glb: object "),
                             HasSubstr("plays no animation; it has 0 without a name (1 s), 1 "
                                       "\"sway\" (3 s); give the name, the index"))));
}

TEST_F(GltfAnimations, AreChosenByNameOrIndex) {
  gltf.root("a", gltf.triangle_mesh());
  const auto named = [&](const char* name, float duration_s) {
    Json animation = movement(0, 2, duration_s);
    animation["name"] = name;
    return animation;
  };
  gltf.json["animations"] = {movement(0, 2, 1), named("0", 2), named("twice", 3),
                             named("twice", 4)};
  const auto duration_of = [&](const char* which) {
    object.animation = which;
    return load().animations.at(0).duration_s;
  };
  EXPECT_EQ(duration_of("0"), 2);  // a name goes before an index
  EXPECT_EQ(duration_of("1"), 2);
  EXPECT_EQ(duration_of("twice"), 3);
  EXPECT_EQ(duration_of("3"), 4);
  gltf.json["animations"].erase(1);
  EXPECT_EQ(duration_of("0"), 1);
}

TEST_F(GltfAnimations, ThatAreNotThereAreAnsweredWithAList) {
  gltf.root("a", gltf.triangle_mesh());
  object.animation = "wlak";
  EXPECT_THAT(error(), HasSubstr("has no animation \"wlak\"; it has none"));
  gltf.json["animations"] = {movement(0, 2, 1), movement(0, 2, 2.5)};
  gltf.json["animations"][1]["name"] = "walk";
  const char* list =
      "; it has 0 without a name (1 s), 1 \"walk\" (2.5 s); give the name, the index "
      "or \"*\" for all";
  EXPECT_THAT(error(), HasSubstr(std::string("\"wlak\"; did you mean \"walk\"?") + list));
  for (const char* which : {"2", "-1", "0x0", "1 ", "99999999999999999999999"}) {
    object.animation = which;
    EXPECT_THAT(error(), HasSubstr(std::string("has no animation \"") + which + "\"" + list));
  }
  for (int i = 2; i < 30; ++i) gltf.json["animations"].push_back(movement(0, 2, 1));
  EXPECT_THAT(error(), HasSubstr("19 without a name (1 s) and 10 more; give"));
}

// The animations move a node each and both the third, which follows the later one.
TEST_F(GltfAnimations, PlayAllAtOnce) {
  const int mesh = gltf.triangle_mesh();
  for (const char* name : {"a", "b", "c"}) gltf.root(name, mesh);
  const auto both = [&](int node, float end, float duration_s) {
    Json animation = movement(node, end, duration_s);
    animation["channels"].push_back(
        {{"sampler", 0}, {"target", {{"node", 2}, {"path", "translation"}}}});
    return animation;
  };
  gltf.json["animations"] = {both(0, 4, 4), both(1, 3, 1)};
  object.animation = "*";
  const Scene loaded = load();
  EXPECT_THAT(loaded.notes,
              Contains(HasSubstr("animation 0 and animation 1 animate the same property of a node; "
                                 "there the later one is played")));
  const Animation& animation = loaded.animations.at(0);
  EXPECT_EQ(animation.duration_s, 4);
  ASSERT_EQ(animation.instances.size(), 3u);
  const std::vector<glm::dmat4> nodes = world_from_nodes(animation, 2);
  const double expected[] = {-2, -3, -3};  // the world's Y is glTF's -Z
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(nodes[animation.instances[i].node][3].y, expected[i]) << i;
}

TEST_F(GltfAnimations, OfWhatGltfDoesNotNameAreNotedAndNotPlayed) {
  gltf.root("a", gltf.triangle_mesh());
  go();
  gltf.json["animations"][0]["channels"].push_back(
      {{"sampler", 0}, {"target", {{"node", 0}, {"path", "pointer"}}}});
  EXPECT_THAT(load().notes, Contains(HasSubstr("its channels of \"pointer\" are not played")));
}

TEST_F(GltfAnimations, AreRefusedWhereTheyMakeNoSense) {
  gltf.root("a", gltf.triangle_mesh());
  go();
  object.animation = "goo";
  EXPECT_THAT(error(), HasSubstr("has no animation \"goo\"; did you mean \"go\"?"));
  object.animation = "go";
  const std::string sampler = "/animations/0/samplers/0", channel = "/animations/0/channels/0";
  const int backwards = gltf.values<float>(5126, "SCALAR", {1, 0});
  const int three = gltf.values<float>(5126, "SCALAR", {0, 1, 2});
  expect_refused(
      {{sampler, {{"input", 0}, {"output", 0}}, "components"},
       {sampler + "/input", backwards, "not increasing"},
       {sampler + "/input", three, "has 2 values"},
       {sampler + "/interpolation", "BEZIER", "BEZIER"},
       {channel + "/sampler", 7, "no sampler 7"},
       {channel + "/target/node", 9, "no node 9"},
       {"/nodes", R"([{"mesh": 0}, {"children": [2]}, {"children": [1]}])"_json, "own ancestor"},
       {"/nodes", R"([{"mesh": 0}, {"children": [0]}, {"children": [0]}])"_json, "two parents"},
       {"/nodes/0/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "has a matrix"}});
}

}  // namespace previz::test::gltf_animation_test
