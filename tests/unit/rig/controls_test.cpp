// Every action of the table, by what it sets.
#include "daemon/rig/controls.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "tests/support/test.hpp"

namespace previz::rig::controls_test {

set::Set stage() {
  set::Set set;
  set.objects.resize(3);
  set.objects[0].name = "table";
  set.objects[0].presence = set::Presence::phantom;
  set.objects[1].name = "vase";
  set.objects[2].name = "bird";
  set.objects[1].world_from_file = glm::translate(glm::dmat4(1), {1, 2, 3});
  set.lights.resize(2);
  set.lights[0].name = "key";
  set.lights[0].gain_mixed = 0.5;
  set.lights[1].name = "fill";
  set.quality.samples = 16;
  return set;
}

struct Desk {
  set::Set set = stage();
  scene::Scene scene_of_files = {};
  Controls controls{set, {}, scene_of_files};
  Outcome operator()(const char* action) { return controls.perform(*set::find_action(action)); }
  session::SceneState scene() const { return pipeline::scene_state(set, controls.look().edits); }
};

TEST(ActionTable, NamesAreUniqueAndEveryOneIsExplained) {
  std::set<std::string> names;
  for (const set::Action& action : set::actions()) {
    EXPECT_TRUE(names.insert(action.name).second) << action.name;
    EXPECT_EQ(set::find_action(action.name), &action);
    EXPECT_EQ(std::string(action.about).back(), '.') << action.name;
  }
  EXPECT_EQ(set::action_names().size(), names.size());
  EXPECT_EQ(set::find_action("make_coffee"), nullptr);
}

// In any state whatever: an action says something, and either does something or is refused.
TEST(ActionTable, EveryActionAnswers) {
  for (const set::Action& action : set::actions()) {
    Desk desk;
    const Outcome outcome = desk.controls.perform(action);
    EXPECT_FALSE(outcome.said.empty()) << action.name;
    Controls bare{set::Set{}};
    EXPECT_FALSE(bare.perform(action).said.empty()) << action.name;
  }
}

TEST(Controls, SamplesGoThroughTheirStepsAndStopAtTheEnds) {
  Desk desk;
  EXPECT_EQ(desk("samples_up").said, "24 samples");
  for (int i = 0; i < 5; ++i) desk("samples_up");
  EXPECT_EQ(desk.controls.look().samples, 50);
  for (int i = 0; i < 20; ++i) desk("samples_down");
  EXPECT_EQ(desk.controls.look().samples, 1);
  desk.set.quality.samples = 64;  // more than a preview has steps for
  Desk fine{desk.set};
  EXPECT_EQ(fine("samples_up").said, "64 samples");
  EXPECT_EQ(fine("samples_down").said, "50 samples");
}

TEST(Controls, SamplesGoOnFromTheGovernorsNumberAndTheRateCanBeHadBack) {
  set::Set set = stage();
  set.quality.fps = 25;
  Desk desk{set};
  EXPECT_TRUE(desk.controls.look().governed);
  desk.controls.use_governed(3);
  EXPECT_EQ(desk("samples_up").said, "4 samples");
  EXPECT_FALSE(desk.controls.look().governed);
  desk.controls.use_governed(9);  // of a picture before the press
  EXPECT_EQ(desk("samples_down").said, "3 samples");
  EXPECT_EQ(desk("hold_rate").said, "holding 25 frames per second");
  EXPECT_TRUE(desk.controls.look().governed);
  EXPECT_EQ(desk.controls.look().samples, set.quality.samples)
      << "a refinement begins with the set's";
  set.quality.fps = 0;
  EXPECT_TRUE(Desk{set}("hold_rate").refused);
}

TEST(Controls, OnlyVirtualObjectsAreMovedAndEachKeepsItsPlace) {
  Desk desk;
  EXPECT_EQ(desk.controls.selected_object(), "vase");
  desk("move_right");
  desk("move_right");
  desk("move_up");
  EXPECT_EQ(desk("next_object").said, "object: bird");
  desk("move_back");
  EXPECT_EQ(desk("next_object").said, "object: vase");
  EXPECT_EQ(desk("previous_object").said, "object: bird");
  const session::SceneState scene = desk.scene();
  ASSERT_EQ(scene.objects.size(), 2u);
  const glm::dvec3 vase(scene.objects.at("vase").value()[3]),
      bird(scene.objects.at("bird").value()[3]);
  EXPECT_NEAR(glm::length(vase - glm::dvec3(1.02, 2, 3.01)), 0, 1e-15);
  EXPECT_NEAR(glm::length(bird - glm::dvec3(0, -0.01, 0)), 0, 1e-15);
}

// 18 turns of 5 degrees are a quarter, about the vase's own place.
TEST(Controls, TurningAndScalingAreAboutTheObjectsOrigin) {
  Desk desk;
  for (int i = 0; i < 18; ++i) desk("turn_left");
  desk("scale_up");
  const glm::dmat4 vase = desk.scene().objects.at("vase").value();
  EXPECT_NEAR(glm::length(glm::dvec3(vase[3]) - glm::dvec3(1, 2, 3)), 0, 1e-14);
  EXPECT_NEAR(glm::length(glm::dvec3(vase[0]) - glm::dvec3(0, 1.05, 0)), 0, 1e-14);
  desk("reset_object");
  EXPECT_TRUE(desk.scene().objects.empty());
}

// The vase's file looks in none of its variants as it does without one, the bird's as in "wet".
TEST(Controls, StepsThroughTheVariantsOfTheSelectedObject) {
  scene::Scene painted;
  painted.variants = {{1, {"red", "blue"}, "", {}}, {2, {"dry", "wet"}, "wet", {}}};
  Desk desk{stage(), painted};
  const auto shown = [&](const std::string& object) { return desk.scene().variants.at(object); };
  EXPECT_EQ(desk("next_variant").said, "vase: variant \"red\" (2 of 3)");
  EXPECT_EQ(shown("vase"), "red");
  EXPECT_TRUE(desk.scene().objects.empty()) << "not moved";
  EXPECT_EQ(desk("next_variant").said, "vase: variant \"blue\" (3 of 3)");
  EXPECT_EQ(desk("next_variant").said, "vase: no variant (1 of 3)");
  EXPECT_EQ(shown("vase"), "");
  EXPECT_EQ(desk("previous_variant").said, "vase: variant \"blue\" (3 of 3)");
  desk("next_object");
  EXPECT_EQ(desk("next_variant").said, "bird: variant \"dry\" (1 of 2)")
      << "it was shown as if wet";
  EXPECT_EQ(desk("next_variant").said, "bird: variant \"wet\" (2 of 2)");
  desk("reset_object");
  EXPECT_FALSE(desk.scene().variants.contains("bird"));
  EXPECT_EQ(shown("vase"), "blue");
}

scene::Scene tagged() {
  scene::Scene scene;
  scene.instances.resize(1);
  scene.instances[0].tag = scene::TagPart::printed;
  return scene;
}

TEST(Controls, HidesTagsAndShowsThemAgain) {
  Desk desk{stage(), tagged()};
  EXPECT_EQ(desk("tags").said, "tags hidden");
  EXPECT_EQ(desk.scene().hides_tags, true);
  EXPECT_EQ(desk("tags").said, "tags shown");
  EXPECT_EQ(desk.controls.look().edits, pipeline::Edits{}) << "as the set has it";
  set::Set hiding = stage();
  hiding.hides_tags = true;
  Desk other{hiding, tagged()};
  EXPECT_EQ(other("tags").said, "tags shown");
  EXPECT_EQ(other.scene().hides_tags, false);
}

TEST(Controls, TurnsTheEnvironmentFile) {
  EXPECT_EQ(Desk()("environment_left").said,
            "no environment file lights this set; nothing to turn");
  set::Set lit = stage();
  lit.lighting.environment = "room.exr";
  Desk desk{lit};
  EXPECT_EQ(desk("environment_left").said, "environment turned by +5 degrees");
  EXPECT_NEAR(desk.scene().environment_turn_rad.value_or(0), glm::radians(5.0), 1e-12);
  for (int i = 0; i < 36; ++i) desk("environment_left");
  EXPECT_EQ(desk("environment_right").said, "environment turned by +180 degrees");
  for (int i = 0; i < 36; ++i) desk("environment_right");
  EXPECT_NEAR(desk.controls.look().edits.environment_turn_rad, 0, 1e-12);
}

TEST(Controls, TagsThatNoPhantomHasCannotBeHidden) {
  const Outcome outcome = Desk()("tags");
  EXPECT_TRUE(outcome.refused);
  EXPECT_EQ(outcome.said, "no phantom of this set has printed tags; previz model makes one");
}

TEST(Controls, InAReviewTagsAreHiddenFromWhatTheTakeHas) {
  Desk desk{stage(), tagged()};
  desk.controls.happened(live::Event::good_frame);
  desk.controls.happened(live::Event::take_finished);
  desk("review");
  ASSERT_TRUE(desk.controls.look().of_take);
  desk.controls.use_recorded({.hides_tags = true});
  EXPECT_EQ(desk("tags").said, "tags shown");
  session::SceneState recorded;
  recorded.hides_tags = true;
  const auto now = [&] {
    return pipeline::with_edits(recorded, desk.set, desk.controls.look().take_edits).hides_tags;
  };
  EXPECT_EQ(now(), false);
  EXPECT_EQ(desk("tags").said, "tags hidden");
  EXPECT_EQ(now(), true);
  EXPECT_EQ(desk.scene().hides_tags, std::nullopt) << "the live picture's";
}

TEST(Controls, AnObjectWithoutVariantsHasNoNext) {
  Desk desk;
  const Outcome outcome = desk("next_variant");
  EXPECT_TRUE(outcome.refused);
  EXPECT_EQ(outcome.said, "vase has no variants in its file");
}

// What is stepped from is what is seen: the take's own variant, and on top of it what was chosen in
// the review.
TEST(Controls, InAReviewVariantsAreSteppedFromThoseOfTheTake) {
  scene::Scene painted;
  painted.variants = {{1, {"red", "green", "blue"}, "red", {}}};
  Desk desk{stage(), painted};
  Controls& controls = desk.controls;
  desk("next_variant");
  EXPECT_EQ(controls.look().edits.objects.at("vase").variant, "green");
  controls.happened(live::Event::good_frame);
  controls.happened(live::Event::take_finished);
  desk("review");
  ASSERT_TRUE(controls.look().of_take);
  EXPECT_EQ(desk("previous_variant").said, "vase: variant \"blue\" (3 of 3)")
      << "the set's was red";
  desk("reset_object");
  controls.use_recorded({.variants = {{"vase", "green"}}});
  EXPECT_EQ(desk("next_variant").said, "vase: variant \"blue\" (3 of 3)");
  session::SceneState recorded;
  recorded.variants["vase"] = "green";
  const session::SceneState state =
      pipeline::with_edits(recorded, desk.set, controls.look().take_edits);
  EXPECT_EQ(state.variants.at("vase"), "blue");
  EXPECT_TRUE(state.objects.empty());
  EXPECT_EQ(controls.look().edits.objects.at("vase").variant, "green") << "the live picture's";
}

TEST(Controls, VariantsThatTheFilesNoLongerHaveAreDropped) {
  const set::Set set = stage();
  scene::Scene painted;
  painted.variants = {{1, {"red"}, "", {}}};
  pipeline::Edits edits;
  edits.objects["vase"].variant = "red";
  edits.objects["bird"].variant = "wet";
  EXPECT_EQ(pipeline::drop_unknown_variants(edits, set, painted),
            std::vector<std::string>{"\"wet\" of \"bird\""});
  EXPECT_EQ(edits.objects.size(), 1u);
  edits.objects["vase"].scale = 2;
  EXPECT_EQ(pipeline::drop_unknown_variants(edits, set, {}).size(), 1u);
  EXPECT_EQ(edits.objects.at("vase"), pipeline::ObjectEdit{.scale = 2}) << "its size is kept";
}

TEST(Controls, OppositeStepsComeBack) {
  const char* pairs[][2] = {{"move_left", "move_right"},      {"move_back", "move_forward"},
                            {"move_up", "move_down"},         {"turn_left", "turn_right"},
                            {"tilt_forward", "tilt_back"},    {"roll_left", "roll_right"},
                            {"scale_up", "scale_down"},       {"light_up", "light_down"},
                            {"light_warmer", "light_cooler"}, {"light_greener", "light_pinker"},
                            {"exposure_up", "exposure_down"}};
  for (const auto& [there, back] : pairs) {
    Desk desk;
    desk(there);
    EXPECT_TRUE(desk.scene() != session::SceneState{} || desk.controls.look().exposure_steps != 0)
        << there;
    desk(back);
    for (const auto& [name, matrix] : desk.scene().objects)
      for (int c = 0; c < 4; ++c)
        EXPECT_NEAR(glm::length(matrix.value()[c] - desk.set.objects[1].world_from_file[c]), 0,
                    1e-15);
    for (const auto& [name, light] : desk.scene().lights) {
      EXPECT_NEAR(light->gain_mixed, 0.5, 1e-15);
      EXPECT_NEAR(glm::length(light->tint - glm::dvec3(1)), 0, 1e-15);
    }
    EXPECT_EQ(desk.controls.look().exposure_steps, 0);
  }
}

// Three steps of a third are a stop.
TEST(Controls, LampsAreDimmedInStopsAndTinted) {
  Desk desk;
  for (int i = 0; i < 3; ++i) desk("light_up");
  desk("next_light");
  desk("light_warmer");
  const session::SceneState scene = desk.scene();
  EXPECT_NEAR(scene.lights.at("key")->gain_mixed, 1.0, 1e-15);
  const glm::dvec3 fill = scene.lights.at("fill")->tint;
  EXPECT_NEAR(std::log2(fill.r / fill.b), 0.1, 1e-15);
  EXPECT_EQ(fill.g, 1);
  desk("reset_light");
  EXPECT_EQ(desk.scene().lights.size(), 1u);
}

TEST(Controls, TurnsAreReportedInDegrees) {
  Desk desk;
  EXPECT_EQ(desk("turn_left").said, "vase turned by +0.0 +0.0 +5.0 degrees");
  EXPECT_EQ(desk("tilt_back").said.substr(0, 19), "vase turned by -5.0");
  desk("tilt_forward");
  EXPECT_EQ(desk("turn_right").said, "vase turned by +0.0 +0.0 +0.0 degrees");
}

const pipeline::FoundLamp first{"found 1", {1, 0, 0}, 0.05}, second{"found 2", {0, 1, 0}, 0.05};

// Lamps that nobody has declared come after the set's own.
TEST(Controls, FoundLampsAreSelectedAndChangedByTheirDirection) {
  Desk desk;
  desk.controls.use_found({first, second});
  desk("next_light");
  EXPECT_EQ(desk("next_light").said, "lamp: found 1");
  EXPECT_EQ(desk("light_down").said, "found 1 -0.33 stops");
  const pipeline::LightEdit& edit = desk.controls.look().edits.lights.at("found 1");
  EXPECT_EQ(edit.found_towards, first.direction);
  EXPECT_EQ(desk.scene().lights.at("found 1")->direction, -first.direction);
  EXPECT_EQ(desk("next_light").said, "lamp: found 2");
  EXPECT_EQ(desk("next_light").said, "lamp: key");
}

// Its number is the light frame's; its direction is the lamp's.
TEST(Controls, AChangedLampKeepsItsName) {
  Desk desk;
  desk.controls.use_found({first, second});
  for (int i = 0; i < 3; ++i) desk("next_light");
  desk("light_up");  // found 2
  desk.controls.use_found(
      {{"found 1", second.direction, 0.05}, {"found 2", first.direction, 0.05}});
  EXPECT_EQ(desk.controls.selected_light(), "found 2");
  desk("light_up");
  ASSERT_EQ(desk.controls.look().edits.lights.size(), 1u);
  EXPECT_EQ(desk.controls.look().edits.lights.at("found 2").found_towards, second.direction);
  EXPECT_EQ(desk("next_light").said, "lamp: key");
  EXPECT_EQ(desk("previous_light").said, "lamp: found 2");
  EXPECT_EQ(desk("previous_light").said, "lamp: found 1") << "the other one has another name";
}

// Two tubes side by side, each within reach of the other.
TEST(Controls, NeighboursAreNotTakenForEachOther) {
  const auto lamp = [](const char* name, double angle) {
    return pipeline::FoundLamp{name, {std::cos(angle), std::sin(angle), 0}, 0.05};
  };
  const pipeline::FoundLamp a = lamp("found 1", 0), b = lamp("found 2", 0.1);
  Desk desk;
  desk.controls.use_found({a, b});
  desk("previous_light");
  EXPECT_EQ(desk("light_down").said, "found 2 -0.33 stops");
  desk.controls.use_found({a, b});
  EXPECT_EQ(desk("light_down").said, "found 2 -0.67 stops");
  EXPECT_EQ(desk("previous_light").said, "lamp: found 1");
  desk("light_up");
  const auto& edits = desk.controls.look().edits.lights;
  ASSERT_EQ(edits.size(), 2u);
  EXPECT_EQ(edits.at("found 1").found_towards, a.direction);
  EXPECT_EQ(edits.at("found 2").found_towards, b.direction);
}

// A new lamp does not inherit the change of one that is off by its number.
TEST(Controls, ANewLampHasNotTheNameOfAChangedOne) {
  Desk desk;
  desk.controls.use_found({first});
  desk("previous_light");
  desk("light_down");  // found 1
  desk.controls.use_found({{"found 1", second.direction, 0.05}});
  EXPECT_EQ(desk("light_down").said, "found 1 -0.67 stops") << "it is off, and its change goes on";
  EXPECT_EQ(desk("next_light").said, "lamp: key");
  EXPECT_EQ(desk("previous_light").said, "lamp: found 2");
  desk("light_down");
  EXPECT_EQ(desk.controls.look().edits.lights.at("found 2").found_towards, second.direction);
}

TEST(Controls, ALampThatIsGoneIsNotChangedNorAnotherInItsPlace) {
  Desk desk;
  desk.controls.use_found({first});
  desk("previous_light");
  desk.controls.use_found({});
  const Outcome outcome = desk("light_down");
  EXPECT_TRUE(outcome.refused);
  EXPECT_EQ(outcome.said, "found 1 is not in the current light");
  EXPECT_TRUE(desk.controls.look().edits.lights.empty());
  EXPECT_EQ(desk("next_light").said, "lamp: key");
}

TEST(Controls, AFoundLampHasNoNameOfTheSets) {
  set::Set set = stage();
  set.captured_lamps.push_back({"found 1", {0, 0, 1}, {}, 0.1});
  Desk desk{set};
  desk.controls.use_found({first});
  EXPECT_EQ(desk("previous_light").said, "lamp: found 2");
  EXPECT_EQ(desk("previous_light").said, "lamp: found 1");
}

// What is changed in a take in review is the take's, also while it is refined, until another take
// is recorded.
TEST(Controls, AReviewHasChangesOfItsOwn) {
  Desk desk;
  desk("move_right");
  desk.controls.happened(live::Event::good_frame);
  desk.controls.happened(live::Event::take_finished);
  desk("review");
  desk("move_up");
  desk("refine");
  EXPECT_TRUE(desk.controls.look().of_take);
  EXPECT_TRUE(desk("keep").refused);
  desk("light_up");
  EXPECT_EQ(desk.controls.look().take_edits.objects.at("vase").offset_m, glm::dvec3(0, 0, 0.01));
  EXPECT_EQ(desk.controls.look().take_edits.lights.size(), 1u);
  EXPECT_EQ(desk.controls.look().edits.objects.at("vase").offset_m, glm::dvec3(0.01, 0, 0));
  EXPECT_TRUE(desk.controls.look().edits.lights.empty());
  desk("live");
  EXPECT_FALSE(desk.controls.look().of_take);
  desk("refine");
  EXPECT_FALSE(desk.controls.look().of_take);
  EXPECT_EQ(desk("keep").request, Request::keep_edits);
  EXPECT_NE(desk.controls.look().take_edits, pipeline::Edits{});
  desk.controls.happened(live::Event::take_finished);
  EXPECT_EQ(desk.controls.look().take_edits, pipeline::Edits{});
}

TEST(Controls, KeepWritesWhatIsChangedAndOnlyThat) {
  Desk desk;
  EXPECT_TRUE(desk("keep").refused);
  desk("move_right");
  EXPECT_EQ(desk("keep").request, Request::keep_edits);
  Controls again(desk.set, desk.controls.look().edits);
  EXPECT_EQ(again.look().edits, desk.controls.look().edits);
  desk("record");
  EXPECT_TRUE(desk("keep").refused);
}

TEST(Controls, RecordingAsksForATakeAndForItsEnd) {
  Desk desk;
  EXPECT_EQ(desk("record").request, Request::start_take);
  EXPECT_TRUE(desk("reload_set").refused);
  EXPECT_TRUE(desk("next_set").refused);
  EXPECT_TRUE(desk("standby").refused);
  EXPECT_EQ(desk("mark_good").request, Request::mark_good);
  EXPECT_EQ(desk("acknowledge").request, Request::acknowledge);
  EXPECT_EQ(desk("record").request, Request::stop_take);
  EXPECT_EQ(desk("reload_set").request, Request::reload_set);
  EXPECT_EQ(desk("next_set").request, Request::next_set);
  EXPECT_EQ(desk("previous_set").request, Request::previous_set);
  EXPECT_TRUE(desk("mark_good").refused);  // no frame was recorded
}

TEST(Controls, ATakeThatIsStillWrittenCanBeMarkedAndNotReviewed) {
  Desk desk;
  desk.controls.use_take({.name = "12A_take002", .is_ending = true, .behind_s = 1.6});
  EXPECT_EQ(desk("mark_good").request, Request::mark_good);
  EXPECT_EQ(desk("mark_good").said, "12A_take002 is marked good when it is written");
  EXPECT_EQ(desk("review").said, "12A_take002 is still being written: 1.6 s");
  EXPECT_TRUE(desk.controls.happened(live::Event::wish_review).refused);
  desk.controls.happened(live::Event::take_finished);
  EXPECT_TRUE(desk("review").refused);
  desk.controls.use_take({.name = "12A_take002"});
  EXPECT_EQ(desk("review").said, "review");
  desk.controls.use_take({.name = "12A_take002", .is_ending = true});
  EXPECT_EQ(desk("review").said, "live");
  desk.controls.use_take({.name = "12A_take002", .is_of_this_set = false});
  EXPECT_THAT(desk("review").said, HasSubstr("recorded with another text of the set"));
  EXPECT_EQ(desk.controls.look().state.mode, live::Mode::live);
  EXPECT_EQ(desk("mark_good").said, "marking 12A_take002 good");
}

TEST(Controls, ASnapshotOfNoPictureIsRefused) {
  Desk desk;
  EXPECT_EQ(desk("snapshot").said, "no frame with a pose and light yet; nothing to save");
  desk.controls.happened(live::Event::good_frame);
  EXPECT_EQ(desk("snapshot").request, Request::snapshot);
  EXPECT_EQ(desk.controls.look().snapshots, 1u);
  desk("standby");
  EXPECT_EQ(desk("snapshot").said, "standby shows no picture; nothing to save");
  EXPECT_EQ(desk.controls.look().snapshots, 1u);
}

TEST(Controls, APushEndsARefinementBeforeItsKindIsKnown) {
  Desk desk;
  EXPECT_TRUE(desk("refine").refused);
  desk.controls.happened(live::Event::good_frame);
  EXPECT_EQ(desk("refine").said, "refine");
  EXPECT_TRUE(desk.controls.pushed());
  EXPECT_EQ(desk.controls.look().state.mode, live::Mode::live);
  EXPECT_FALSE(desk.controls.pushed());
}

TEST(Controls, AveragingOverFramesIsTheSetsUntilItIsSwitched) {
  Desk desk;
  EXPECT_TRUE(desk.controls.look().accumulates);
  EXPECT_EQ(desk("accumulate").said, "frame averaging off");
  EXPECT_FALSE(desk.controls.look().accumulates);
  EXPECT_EQ(desk("accumulate").said, "frame averaging on");
  set::Set set;
  set.quality.accumulate = false;
  EXPECT_FALSE(Controls(set).look().accumulates);
}

TEST(Controls, PassTimesBringBackAnOverlayThatIsHidden) {
  Desk desk;
  const live::Look& look = desk.controls.look();
  EXPECT_FALSE(look.pass_times);
  EXPECT_EQ(desk("pass_times").said, "pass times on");
  EXPECT_TRUE(look.pass_times);
  EXPECT_EQ(desk("pass_times").said, "pass times off");
  EXPECT_TRUE(look.osd);
  desk("pass_times");
  desk("osd");
  EXPECT_EQ(desk("pass_times").said, "pass times on");
  EXPECT_TRUE(look.pass_times && look.osd);
}

TEST(Controls, GuidesAreSwitchedWhateverTheOverlayDoes) {
  Desk desk;
  EXPECT_FALSE(desk.controls.look().guides);
  desk("osd");
  EXPECT_EQ(desk("guides").said, "guides on");
  EXPECT_TRUE(desk.controls.look().guides);
  EXPECT_FALSE(desk.controls.look().osd);
  EXPECT_EQ(desk("guides").said, "guides off");
  EXPECT_FALSE(desk.controls.look().guides);
}

TEST(Controls, EstimatorAndViewGoAround) {
  Desk desk;
  EXPECT_EQ(desk("estimator").said, "estimator: difference");
  EXPECT_EQ(desk("estimator").said, "estimator: paired");
  for (std::size_t i = 0; i + 1 < render::all_views.size(); ++i) desk("debug_view");
  EXPECT_EQ(desk.controls.look().view, render::all_views.back());
  EXPECT_EQ(desk("debug_view").said, "view: composite");
}

}  // namespace previz::rig::controls_test
