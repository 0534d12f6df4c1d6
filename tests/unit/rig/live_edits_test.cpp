// Takes in review, and what buttons change in them and in the live picture, from end to end.
#include "daemon/core/set/load.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::live_edits_test {

using test::RigLive;

// A review's own thread plays until it is asked to end.
TEST_F(RigLive, MayEndOrChangeItsSetInAReview) {
  write_set();
  run([&] {
    const auto review = [&](const std::string& take) {
      const int before = until_samples(2).count;
      press("record");
      until([&](const Shown& s) { return s.look.state.recording && s.count > before + 8; });
      end_take(take);
      press("review");
      until_said("button review: review");
    };
    review("12A_take001");
    press("reload_set");
    until_said("reloading the set file");
    review("12A_take002");
  });
  EXPECT_EQ(count_said("button review: review"), 2);
  for (const char* name : {"12A_take001", "12A_take002"}) {
    const session::Session take = session::open_session(directory_ / "takes" / name);
    EXPECT_TRUE(take.missing.empty()) << name << ": " << testing::PrintToString(take.missing);
  }
}

// A take in review is moved and relit on top of what was recorded with it, by its own light and
// poses, also while it is refined; the live picture knows nothing of that.
TEST_F(RigLive, ATakeInReviewIsChangedOnTopOfItsRecord) {
  write_set();
  const auto place_of = [](const Shown& s, const char* name) {
    return glm::dvec3(s.shot.scene.objects.at(name).value()[3]);
  };
  const auto has = [](const Shown& s, const char* name) {
    return s.shot.scene.objects.contains(name);
  };
  run_rendering([&] {
    press("move_right");
    until([&](const Shown& s) { return has(s, "card"); });
    const Shown first = begin_take();
    const Shown last = until([&](const Shown& s) { return is_long_after(s, first); });
    end_take();
    press("move_right");  // live only: the take has one step
    until([&](const Shown& s) { return has(s, "card") && place_of(s, "card").x > 0.019; });

    press("review");
    const auto in_review = [&](const Shown& s) {  // not a live picture that was on its way
      return s.look.state.mode == live::Mode::review && s.shot.samples == 2 &&
             s.shot.frame->timestamp_ns <= last.shot.frame->timestamp_ns;
    };
    // The first frames may have been captured before the first step.
    const Shown plain = until([&](const Shown& s) { return in_review(s) && has(s, "card"); });
    EXPECT_NEAR(place_of(plain, "card").x, 0.01, 1e-12);
    press("move_up");
    press("light_down");
    const Shown moved = until([&](const Shown& s) {
      return in_review(s) && has(s, "card") && place_of(s, "card").x > 0.009 &&
             place_of(s, "card").z > 0.009 && s.shot.scene.lights.contains("key");
    });
    EXPECT_NEAR(place_of(moved, "card").x, 0.01, 1e-12);
    EXPECT_NEAR(moved.shot.scene.lights.at("key")->gain_mixed, std::exp2(-1.0 / 3), 1e-12);
    EXPECT_TRUE(moved.look.edits.lights.empty());

    press("refine");
    const Shown refined = until_frozen();
    EXPECT_EQ(refined.look.state.mode, live::Mode::refine);
    EXPECT_NEAR(place_of(refined, "card").x, 0.01, 1e-12);
    EXPECT_NEAR(place_of(refined, "card").z, 0.01, 1e-12);
    press("live");
    const Shown live = until([](const Shown& s) {
      return s.look.state.mode == live::Mode::live && s.shot.samples == 2 && !s.shot.frozen;
    });
    EXPECT_NEAR(place_of(live, "card").x, 0.02, 1e-12);
    EXPECT_NEAR(place_of(live, "card").z, 0, 1e-12);
    EXPECT_FALSE(live.shot.scene.lights.contains("key"));

    // What is refined from standby is the rig's picture, not the take's.
    press("review");
    until([&](const Shown& s) { return in_review(s); });
    press("standby");
    press("refine");
    const Shown again = until_frozen();
    EXPECT_FALSE(again.look.of_take);
    EXPECT_NEAR(place_of(again, "card").x, 0.02, 1e-12);
  });
}

// A typing error that is mended in the set does not undo what the crew has placed; `keep` writes it
// into the file.
TEST_F(RigLive, ChangesOutlastTheSetAndAreKeptInItsFile) {
  write_set();
  const std::filesystem::path file = directory_ / "set.toml";
  run_rendering([&] {
    press("move_right");
    press("light_down");
    until([](const Shown& s) {
      return s.shot.scene.objects.contains("card") && s.shot.scene.lights.contains("key");
    });
    replace_in_set("samples = 2", "samples = 4");
    const std::string other = test::content_of(file);
    press("reload_set");
    const Shown again = until_samples(4);
    EXPECT_NEAR(glm::dvec3(again.shot.scene.objects.at("card").value()[3]).x, 0.01, 1e-12);
    EXPECT_TRUE(again.shot.scene.lights.contains("key"));
    press("keep");
    until_said("set.toml has the changes");
    const Shown kept = until([](const Shown& s) {
      return s.shot.samples == 4 && !s.shot.scene.objects.contains("card");
    });
    EXPECT_EQ(kept.look.edits, pipeline::Edits{});
    EXPECT_EQ(test::content_of(directory_ / "set.toml.1.old"), other);
  });
  const set::Set set = set::load_set(file);
  EXPECT_NEAR(glm::dvec3(set.objects[1].world_from_file[3]).x, 0.01, 1e-9);
  EXPECT_NEAR(set.lights[0].gain_mixed, std::exp2(-1.0 / 3), 1e-6);
}

// A variant is chosen by a button, recorded, rendered from the take as it was shown, changed in the
// review and kept in the set file; no tree is built for any of it.
TEST_F(RigLive, VariantsAreShownRecordedReviewedAndKept) {
  write_set();
  test::write_card_with_variants(directory_ / "card.gltf");
  const auto variant_of = [](const Shown& s) {
    const auto found = s.shot.scene.variants.find("card");
    return found == s.shot.scene.variants.end() ? "-" : found->second;
  };
  Shown taken;
  run([&] {
    const Shown before = until_samples(2);
    press("next_variant");
    const Shown black = until([&](const Shown& s) { return variant_of(s) == "black"; });
    press("record");
    taken = until([&](const Shown& s) { return s.records(2); });
    until([&](const Shown& s) { return is_long_after(s, taken); });
    end_take();
    press("next_variant");
    const Shown lamp = until(  // a frame that was only shown has no counters
        [&](const Shown& s) { return variant_of(s) == "lamp" && s.shot.samples == 2; });
    EXPECT_EQ(lamp.shot.counters.built_trees, before.shot.counters.built_trees);
    EXPECT_EQ(lamp.shot.counters.uploaded_materials, before.shot.counters.uploaded_materials);

    press("review");
    const auto reviewed = [&](const Shown& s) {
      return s.look.state.mode == live::Mode::review && s.shot.samples == 2 && !s.shot.frozen;
    };
    until([&](const Shown& s) { return reviewed(s) && variant_of(s) == "black"; });
    press("previous_variant");
    until([&](const Shown& s) { return reviewed(s) && variant_of(s) == "grey"; });
    press("live");
    until([&](const Shown& s) {
      return s.look.state.mode == live::Mode::live && variant_of(s) == "lamp";
    });
    press("keep");
    until_said("set.toml has the changes");
    const Shown kept = until([&](const Shown& s) {
      return s.look.edits == pipeline::Edits{} && s.shot.samples == 2 && variant_of(s) == "-";
    });
    EXPECT_EQ(kept.shot.counters.built_trees, before.shot.counters.built_trees)
        << "the set was reloaded";
    EXPECT_GT(kept.shot.counters.uploaded_materials, before.shot.counters.uploaded_materials);
  });
  EXPECT_EQ(set::load_set(directory_ / "set.toml").objects[1].variant, "lamp");
  EXPECT_GT(count_said("card: variant \"black\" (2 of 3)"), 0);
  const session::Session take = session::open_session(take_folder());
  EXPECT_EQ(take.track.back().scene.variants.at("card"), "black");
  const render::Layers post = rendered(take_folder(), taken.shot.frame->timestamp_ns, 2);
  // The middle of the picture shows the card, which is black.
  const std::size_t middle = post.mixed.size() / 2 + static_cast<std::size_t>(post.width) / 2;
  EXPECT_GT(post.mask[middle], 0.99f);
  EXPECT_EQ(post.mixed[middle], glm::vec3(0));
}

// Reading a set again in which nothing but a colour is new builds no tree.
TEST_F(RigLive, AColourThatIsNewInTheSetBuildsNoTree) {
  write_set();
  run([&] {
    const Shown before = until_samples(2);
    std::ofstream(directory_ / "set.toml", std::ios::app)
        << "[[surface]]\nmaterial = \"paper\"\nalbedo = [0.1, 0.2, 0.3]\n";
    replace_in_set("samples = 2", "samples = 4");
    press("reload_set");
    const Shown after = until_samples(4);
    EXPECT_EQ(after.shot.counters.built_trees, before.shot.counters.built_trees);
    EXPECT_EQ(after.shot.counters.uploaded_textures, before.shot.counters.uploaded_textures);
    EXPECT_EQ(after.shot.counters.uploaded_materials, before.shot.counters.uploaded_materials + 1);
  });
}

// What is moved while no picture is made is where it was put when the frozen one is refined.
TEST_F(RigLive, ARefinementShowsWhatWasMovedInStandby) {
  write_set();
  run_rendering([&] {
    press("standby");
    until_said("button standby: standby");
    press("move_right");
    until_said("card moved by +0.010");
    press("refine");
    const Shown refined = until_frozen();
    EXPECT_TRUE(refined.shot.scene.objects.contains("card"));
  });
}

}  // namespace previz::rig::live_edits_test
