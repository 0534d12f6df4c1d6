// What buttons have changed, written into a set file's text: read again, it is what was shown.
#include "daemon/rig/kept_edits.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/set/load.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::kept_edits_test {

constexpr const char* stage = R"(# A set with everything that can be changed.
[[object]]
name = "vase"
file = "vase.glb"   # from the shop
presence = "virtual"
position_m = [1, 2, 3]
rotation_deg = [10, 20, 30]
scale = 2

[[object]]
name = "bird"
file = "vase.glb"
presence = "virtual"
world_from_file = [[2, 0, 0, 1], [0, 3, 0, 0], [0, 0, 4, 0], [0, 0, 0, 1]]

[[light]]
name = "key"
type = "point"
position_m = [0, 0, 1]
emission = [1, 1, 1]

[[light]]
type = "point"   # it has no name
position_m = [0, 0, 1]
emission = [1, 1, 1]

[[captured_light]]
name = "window"
direction = [0, 1, 1]
cone_deg = 5
gain_mixed = 0.5
tint = [1, 0.5, 0.5]

[quality]
samples = 3
)";

class KeptEdits : public testing::Test {
 protected:
  KeptEdits() { std::ofstream(folder_ / "vase.glb") << "not looked into"; }
  set::Set parse(const std::string& text) const {
    return set::parse_set(text, folder_ / "set.toml");
  }
  std::string kept(const pipeline::Edits& edits) const {
    return with_edits(stage, parse(stage), edits);
  }

  test::TemporaryDirectory folder_;
};

TEST_F(KeptEdits, NothingChangedIsNothingWritten) {
  EXPECT_EQ(kept({}), stage);
}

// Random moves, turns and scales; places are kept to a micrometre and angles to 1e-4 degrees, which
// moves an axis of length 2 to 4 by less than 1e-5.
TEST_F(KeptEdits, AnObjectIsWhereItWasShown) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> some(-1, 1);
  for (int i = 0; i < 50; ++i) {
    pipeline::Edits edits;
    for (const char* name : {"vase", "bird"}) {
      pipeline::ObjectEdit& edit = edits.objects[name];
      edit.offset_m = {some(random), some(random), some(random)};
      const glm::dvec3 axis = glm::normalize(glm::dvec3(some(random), some(random), some(random)));
      edit.turn = glm::dmat3(glm::rotate(glm::dmat4(1), 3 * some(random), axis));
      edit.scale = 1 + some(random) / 2;
    }
    const set::Set before = parse(stage), after = parse(kept(edits));
    for (std::size_t o = 0; o < 2; ++o) {
      const glm::dmat4 shown = pipeline::edited(before.objects[o].world_from_file,
                                                edits.objects.at(before.objects[o].name));
      for (int c = 0; c < 4; ++c)
        EXPECT_LT(glm::length(shown[c] - after.objects[o].world_from_file[c]), 1e-5);
    }
  }
}

// A quarter turn about Y, where the angles about X and Z are one.
TEST_F(KeptEdits, AnObjectOnItsSideIsWhereItWasShown) {
  pipeline::Edits edits;
  edits.objects["vase"].turn =
      glm::dmat3(glm::rotate(glm::dmat4(1), std::numbers::pi / 2, glm::dvec3(0, 1, 0)));
  std::string text = stage;
  text.replace(text.find("[10, 20, 30]"), 12, "[0, 0, 30]");
  const set::Set before = parse(text), after = parse(with_edits(text, before, edits));
  const glm::dmat4 shown =
      pipeline::edited(before.objects[0].world_from_file, edits.objects.at("vase"));
  for (int c = 0; c < 4; ++c)
    EXPECT_LT(glm::length(shown[c] - after.objects[0].world_from_file[c]), 1e-5);
}

TEST_F(KeptEdits, OnlyTheChangedKeysAreWritten) {
  pipeline::Edits edits;
  edits.objects["vase"].offset_m = {0.01, 0, 0};
  edits.lights["light 2"].stops = 1;
  edits.lights["window"].stops = -1;
  std::string expected = stage;
  expected.replace(expected.find("[1, 2, 3]"), 9, "[1.01, 2.0, 3.0]");
  expected.replace(expected.find("gain_mixed = 0.5"), 16, "gain_mixed = 0.25");
  const std::string last = "emission = [1, 1, 1]";
  expected.insert(expected.rfind(last) + last.size(), "\ngain_mixed = 2.0");
  EXPECT_EQ(kept(edits), expected);
}

// A variant is a key of its own: the place stays as it is written, also as a matrix.
TEST_F(KeptEdits, AVariantIsWrittenAlone) {
  pipeline::Edits edits;
  edits.objects["vase"].variant = "";
  edits.objects["bird"].variant = "in \"gold\"";
  std::string expected = stage;
  for (const auto& [last, more] : {std::pair("scale = 2", "\nvariant = \"\""),
                                   std::pair("[0, 0, 0, 1]]", "\nvariant = \"in \\\"gold\\\"\"")})
    expected.insert(expected.find(last) + std::string(last).size(), more);
  EXPECT_EQ(kept(edits), expected);
  const set::Set after = parse(kept(edits));
  EXPECT_EQ(after.objects[0].variant, "");
  EXPECT_EQ(after.objects[1].variant, "in \"gold\"");
}

TEST_F(KeptEdits, HiddenTagsAreWrittenIntoTheTableThatTheSetHasOrANewOne) {
  pipeline::Edits edits;
  edits.hides_tags = true;
  const std::string hidden = kept(edits);
  EXPECT_EQ(hidden, std::string(stage) + "\n[tags]\nhide = true\n");
  EXPECT_TRUE(parse(hidden).hides_tags);
  edits.hides_tags = false;
  EXPECT_FALSE(parse(with_edits(hidden, parse(hidden), edits)).hides_tags);
  const std::string in_braces = "tags = {hide = true}\n" + std::string(stage);
  EXPECT_THAT(
      test::error_of([&] { with_edits(in_braces, parse(in_braces), edits); }),
      HasSubstr("tags is an inline table, {...}; write it under a header of its own, [tags]"));
}

TEST_F(KeptEdits, AnEnvironmentIsTurnedFromWhereTheSetHasIt) {
  std::ofstream(folder_ / "room.exr") << "not looked into";
  const std::string text =
      "[lighting]\nenvironment = \"room.exr\"\nenvironment_rotation_deg = 60  # by eye\n";
  pipeline::Edits edits;
  edits.environment_turn_rad = glm::radians(10.0);
  const std::string after = with_edits(text, parse(text), edits);
  EXPECT_NEAR(glm::degrees(parse(after).lighting.environment_rotation_rad), 70, 1e-4);
  EXPECT_THAT(after, HasSubstr("# by eye"));
  EXPECT_EQ(kept(edits), stage) << "it has no environment";
}

TEST_F(KeptEdits, ALampIsAsItWasShown) {
  pipeline::Edits edits;
  for (const char* name : {"key", "window"}) {
    edits.lights[name].stops = 0.5;
    edits.lights[name].warm_stops = 0.4;
    edits.lights[name].green_stops = -0.2;
  }
  pipeline::LightEdit& found = edits.lights["found 3"];
  found = edits.lights["key"];
  found.found_towards = glm::dvec3(0.6, 0, 0.8);
  found.found_radius_rad = 3 * std::numbers::pi / 180;
  const set::Set before = parse(stage), after = parse(kept(edits));
  const session::SceneState shown = pipeline::scene_state(before, edits);
  ASSERT_EQ(after.captured_lamps.size(), 2u);
  EXPECT_EQ(after.captured_lamps[1].name, "found 3");
  EXPECT_NEAR(after.captured_lamps[1].cone_rad * 180 / std::numbers::pi, 5.1, 1e-3);
  const auto near = [](const session::LightState& state, double gain, const glm::dvec3& tint) {
    EXPECT_NEAR(state.gain_mixed, gain, 2e-6);
    EXPECT_LT(glm::length(state.tint - tint), 2e-6);
  };
  near(*shown.lights.at("key"), after.lights[0].gain_mixed, after.lights[0].tint);
  for (const set::CapturedLamp& lamp : after.captured_lamps)
    near(*shown.lights.at(lamp.name), lamp.gain_mixed, lamp.tint);
}

}  // namespace previz::rig::kept_edits_test
