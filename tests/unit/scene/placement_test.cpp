// A scene with things moved and relit: what moves, what goes along, and what stays bit for bit.
#include "daemon/core/scene/placement.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "tests/support/test.hpp"

namespace previz::scene::placement_test {

// Two objects of the set, the second with a lamp of its own, and one lamp of the set.
struct Stage {
  set::Set set;
  Scene scene;
  session::SceneState state;
  Placement placed() const { return place(scene, set, state); }
  Stage() {
    set.objects.resize(2);
    set.objects[0].name = "vase";
    set.objects[1].name = "torch";
    set.objects[1].world_from_file = glm::translate(glm::dmat4(1), {1, 0, 0});
    scene.instances.resize(3);
    for (std::uint32_t i = 0; i < 3; ++i) {
      scene.instances[i].object = i == 0 ? 0 : 1;
      scene.instances[i].world_from_object = glm::translate(glm::dmat4(1), {0.1 * i, 1.0 / 3, 0});
    }
    set::Light flame;
    flame.position = {1, 0, 0.5};
    scene.lights = {flame};
    scene.light_objects = {1, no_object};
    set::Light key;
    key.name = "key";
    key.emission = {2, 3, 4};
    key.gain_real = 1;
    set.lights = {key};
    scene.lights.push_back(key);
  }
};

TEST(Placement, OfNothingIsTheSceneItself) {
  Stage stage;
  const Placement placement = stage.placed();
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(placement.instances[i].world_from_object, stage.scene.instances[i].world_from_object);
  EXPECT_EQ(placement.lights.size(), 2u);
  EXPECT_THAT(placement.unknown, IsEmpty());
}

// A quarter turn about Z through the world's origin, then 1 m up.
TEST(Placement, AnObjectTakesItsLampsAlongAndLeavesTheOthers) {
  Stage stage;
  const glm::dmat4 moved = glm::translate(glm::dmat4(1), {0, 0, 1}) *
                           glm::rotate(glm::dmat4(1), glm::radians(90.0), {0, 0, 1});
  stage.state.objects["torch"] = moved * stage.set.objects[1].world_from_file;
  const Placement placement = stage.placed();
  EXPECT_EQ(placement.instances[0].world_from_object, stage.scene.instances[0].world_from_object);
  for (std::size_t i = 1; i < 3; ++i) {
    const glm::dvec3 was = stage.scene.instances[i].world_from_object[3];
    const glm::dvec3 is = placement.instances[i].world_from_object[3];
    EXPECT_NEAR(glm::length(is - glm::dvec3(-was.y, was.x, was.z + 1)), 0, 1e-15);
  }
  EXPECT_NEAR(glm::length(placement.lights[0].position - glm::dvec3(0, 1, 1.5)), 0, 1e-15);
  EXPECT_EQ(placement.lights[1].position, stage.scene.lights[1].position);
}

TEST(Placement, AnObjectWhereTheSetHasItIsBitForBitWhereItWas) {
  Stage stage;
  stage.state.objects["torch"] = stage.set.objects[1].world_from_file;
  const Placement placement = stage.placed();
  EXPECT_EQ(placement.instances[1].world_from_object, stage.scene.instances[1].world_from_object);
}

TEST(TagParts, AreToldByTheNamesOfNodes) {
  for (const char* name : {"tag 3", "tag 3 paper", "tag 12 print", "tag0", "Tag_7", "tag 3.001"})
    EXPECT_EQ(named_tag(name).part, TagPart::printed) << name;
  for (const char* name : {"under tag 3", "under_tag_3", "Under tag 3.001"})
    EXPECT_EQ(named_tag(name).part, TagPart::under) << name;
  for (const char* name : {"", "tag", "tag cube", "price tag 3", "tag 3a", "stage 3", "under tag",
                           "tag 2 stand", "under tag 3 shelf", "tag 123456"})
    EXPECT_EQ(named_tag(name).part, TagPart::none) << name;
  EXPECT_EQ(named_tag("tag 12 print").id, 12);
  EXPECT_EQ(named_tag("tag 1 " + std::string(300'000, 'x')).part, TagPart::none);
  EXPECT_EQ(named_tag("under tag 3.001").id, 3);
}

TEST(Placement, HidesTagsAndShowsWhatIsUnderThem) {
  Stage stage;
  stage.scene.instances[1].tag = TagPart::printed;
  stage.scene.instances[2].tag = TagPart::under;
  hide_tags(stage.scene.instances, false);
  const auto presences = [&](std::optional<bool> hides) {
    stage.state.hides_tags = hides;
    std::vector<std::uint32_t> all;
    for (const Instance& instance : stage.placed().instances) all.push_back(instance.presence);
    return all;
  };
  const std::vector<std::uint32_t> shown{world_both, world_both, 0},
      hidden{world_both, world_real, world_mixed};
  EXPECT_EQ(presences({}), shown) << "as the set has it";
  EXPECT_EQ(presences(true), hidden);
  EXPECT_EQ(presences(false), shown);
  hide_tags(stage.scene.instances, true);
  EXPECT_EQ(presences({}), hidden);
  EXPECT_EQ(presences(false), shown);
  stage.state.objects["torch"] = std::nullopt;
  EXPECT_EQ(presences(true), (std::vector<std::uint32_t>{world_both, 0, 0}))
      << "what is nowhere is not brought back";
}

// Of a carrier that was not found yet: back at once when it is.
TEST(Placement, WhatIsNowhereIsInNeitherWorld) {
  Stage stage;
  stage.state.objects["torch"] = std::nullopt;
  stage.state.lights["key"] = std::nullopt;
  const Placement placement = stage.placed();
  ASSERT_EQ(placement.instances.size(), 3u);
  EXPECT_EQ(placement.instances[0].presence, world_both);
  EXPECT_EQ(placement.instances[1].presence, 0u);
  EXPECT_EQ(placement.instances[2].presence, 0u);
  for (const set::Light& light : placement.lights) {
    EXPECT_EQ(light.gain_mixed, 0);
    EXPECT_EQ(light.gain_real, 0);
  }
}

// The node goes along X by 2 m a second, and shrinks to nothing at 1 s; then the crew's move.
TEST(Placement, AnimatesBeforeItMoves) {
  Stage stage;
  Animation animation;
  animation.object = 1;
  animation.duration_s = 2;
  AnimatedNode node;
  node.moves = true;
  node.translations = {Interpolation::linear, {0, 2}, {{0, 0, 0, 0}, {4, 0, 0, 0}}};
  node.scales = {Interpolation::linear, {0, 1, 2}, {{1, 1, 1, 0}, {0, 0, 0, 0}, {1, 1, 1, 0}}};
  animation.nodes = {node};
  animation.instances = {{2, 0}};
  animation.lights = {{0, 0}};
  stage.scene.animations = {animation};
  stage.state.animation_s = 0.5;
  stage.state.objects["torch"] =
      glm::translate(glm::dmat4(1), {0, 0, 3}) * stage.set.objects[1].world_from_file;
  Placement placement = stage.placed();
  EXPECT_EQ(placement.instances[2].world_from_object[3], glm::dvec4(1, 0, 3, 1));
  EXPECT_EQ(placement.instances[2].world_from_object[0], glm::dvec4(0.5, 0, 0, 0));
  // The lamp was at (1, 0, 0.5) of the node at rest.
  EXPECT_EQ(placement.lights[0].position, glm::dvec3(1.5, 0, 3.25));
  EXPECT_EQ(placement.instances[0].world_from_object, stage.scene.instances[0].world_from_object);

  stage.state.animation_s = 3;  // 1 s into its second time
  placement = stage.placed();
  EXPECT_EQ(placement.instances[2].presence, 0u);
  EXPECT_EQ(placement.lights[0].gain_mixed, 0);
}

// Two lamps, one of each world, would share no sample, and their difference would be all noise.
TEST(Placement, ARealLampThatIsDimmedAndTintedStaysOneLamp) {
  Stage stage;
  stage.state.lights["key"] = state_of(stage.set.lights[0]);
  stage.state.lights["key"]->gain_mixed = 0.25;
  stage.state.lights["key"]->tint = {2, 1, 0.5};
  const Placement placement = stage.placed();
  ASSERT_EQ(placement.lights.size(), 2u);
  EXPECT_EQ(placement.lights[1].gain_mixed, 0.25);
  EXPECT_EQ(placement.lights[1].tint, glm::dvec3(2, 1, 0.5));
  EXPECT_EQ(placement.lights[1].gain_real, 1);
  EXPECT_EQ(placement.lights[1].emission, stage.set.lights[0].emission);
}

TEST(Placement, ALampThatTheSetTintsKeepsItsTintUnlessTheStateSaysOtherwise) {
  Stage stage;
  stage.set.lights[0].tint = stage.scene.lights[1].tint = {1, 0.5, 0.25};
  EXPECT_EQ(stage.placed().lights[1].tint, glm::dvec3(1, 0.5, 0.25));
  stage.state.lights["key"] = state_of(stage.set.lights[0]);
  EXPECT_EQ(stage.placed().lights[1].tint, glm::dvec3(1, 0.5, 0.25));
  stage.state.lights["key"]->tint = {1, 1, 1};
  EXPECT_EQ(stage.placed().lights[1].tint, glm::dvec3(1));
}

// Of the torch's two instances one is lacquered in the variant.
TEST(Placement, AVariantIsOfTheMaterialsOfItsObjectAlone) {
  Stage stage;
  stage.scene.variants = {{1, {"lacquered"}, "", {{2, {{0, 4}, {3, 5}}}}}};
  stage.scene.instances[2].material = 4;
  stage.state.variants["torch"] = "lacquered";
  Placement placement = stage.placed();
  EXPECT_THAT(placement.unknown, IsEmpty());
  EXPECT_EQ(placement.instances[2].material, 5u);
  EXPECT_EQ(placement.instances[2].mesh, 3u);
  EXPECT_EQ(placement.instances[1].material, 0u);
  EXPECT_EQ(placement.instances[2].world_from_object, stage.scene.instances[2].world_from_object);
  stage.state.variants["torch"] = "";
  EXPECT_EQ(stage.placed().instances[2].material, 4u);
  stage.state.variants["torch"] = "gilded";
  stage.state.variants["vase"] = "gilded";
  placement = stage.placed();
  EXPECT_EQ(placement.instances[2].material, 4u);
  ASSERT_EQ(placement.unknown.size(), 2u);
  EXPECT_EQ(placement.unknown[0],
            "object \"torch\" was shown in variant \"gilded\", which it does not have");
}

TEST(Placement, NamesTheSetHasNotAreTold) {
  Stage stage;
  stage.state.objects["ghost"] = glm::dmat4(1);
  stage.state.lights["moon"] = {};
  const Placement placement = stage.placed();
  EXPECT_THAT(placement.unknown, ElementsAre(HasSubstr("\"ghost\""), HasSubstr("\"moon\"")));
}

}  // namespace previz::scene::placement_test
