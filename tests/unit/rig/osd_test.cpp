// The overlay's words for every state of the rig, as data.
#include "daemon/rig/osd.hpp"

#include "tests/support/test.hpp"

namespace previz::rig::osd_test {

using output::OsdPage;
using output::OsdText;
using output::OsdTone;
using Texts = std::vector<OsdText>;

PictureFacts tracked() {
  PictureFacts facts;
  facts.samples = 8;
  facts.tracking = tracking::TrackStatus::tracked;
  facts.tags = 6;
  facts.deviation_mm = 0.83;
  return facts;
}

RigFacts in(live::Mode mode) {
  RigFacts rig;
  rig.look.state.mode = mode;
  rig.free_bytes = 412'300'000'000;
  return rig;
}

constexpr Pace pace{24.96, 0.0834};

TEST(OsdWords, LivePreview) {
  const PictureFacts picture = tracked();
  const OsdPage page = osd_page(in(live::Mode::live), &picture, pace);
  EXPECT_EQ(page.top_left, (Texts{{"LIVE"}}));
  EXPECT_EQ(page.top_right, (Texts{{"412 GB free"}}));
  EXPECT_EQ(page.bottom_left, (Texts{{"8 samples"}, {"25.0 fps · 83 ms"}}));
  EXPECT_EQ(page.bottom_right, (Texts{{"6 tags · ±0.83 mm"}, {"light: image"}}));
  EXPECT_TRUE(page.notices.empty());
}

TEST(OsdWords, SizeAndHistoryStandBesideTheSamples) {
  PictureFacts picture = tracked();
  picture.width = 1358;
  picture.height = 764;
  EXPECT_EQ(osd_page(in(live::Mode::live), &picture, pace).bottom_left.front(),
            OsdText{"8 samples · 1358x764"});
  picture.history = 12;
  EXPECT_EQ(osd_page(in(live::Mode::live), &picture, pace).bottom_left.front(),
            OsdText{"8 samples + 12 frames · 1358x764"});
}

TEST(OsdWords, RefiningTellsSamplesAndErrorInPlaceOfThePace) {
  PictureFacts picture = tracked();
  picture.samples = 256;
  picture.error = 0.0184;
  const OsdPage page = osd_page(in(live::Mode::refine), &picture, pace);
  EXPECT_EQ(page.top_left, (Texts{{"REFINE", OsdTone::mode}}));
  EXPECT_EQ(page.bottom_left, (Texts{{"256 samples · error 1.8 %"}}));
}

TEST(OsdWords, ATakeTellsItsTimeInEveryModeItCanRunIn) {
  const PictureFacts picture = tracked();
  for (const live::Mode mode : {live::Mode::live, live::Mode::refine}) {
    RigFacts rig = in(mode);
    rig.look.state.recording = true;
    rig.recorded_s = 3600 + 2 * 60 + 3.9;
    rig.take = "12A_take003";
    const OsdPage page = osd_page(rig, &picture, pace);
    ASSERT_EQ(page.top_left.size(), 3u);
    EXPECT_EQ(page.top_left[1], (OsdText{"● 01:02:03", OsdTone::recording}));
    EXPECT_EQ(page.top_left[2], OsdText{"12A_take003"});
  }
}

TEST(OsdWords, ReviewStandbyLightModeAndDebugViews) {
  const PictureFacts picture = tracked();
  EXPECT_EQ(osd_page(in(live::Mode::review), &picture, pace).top_left,
            (Texts{{"REVIEW", OsdTone::mode}}));
  EXPECT_EQ(osd_page(in(live::Mode::standby), &picture, pace).top_left,
            (Texts{{"STANDBY", OsdTone::mode}}));
  RigFacts rig = in(live::Mode::live);
  rig.look.light_mode = set::LightMode::hybrid;
  EXPECT_EQ(osd_page(rig, &picture, pace).bottom_right.back(), OsdText{"light: hybrid"});
  for (const render::View view : render::all_views) {
    rig.look.view = view;
    const Texts top = osd_page(rig, &picture, pace).top_left;
    if (view == render::View::composite)
      EXPECT_EQ(top.size(), 1u);
    else
      EXPECT_EQ(top.back(),
                (OsdText{std::string("view: ") + render::name_of(view), OsdTone::mode}));
  }
}

TEST(OsdWords, FreeSpaceWarnsBeforeItIsGone) {
  RigFacts rig = in(live::Mode::live);
  const auto space = [&](std::uint64_t bytes) {
    rig.free_bytes = bytes;
    return osd_page(rig, nullptr, {}).top_right;
  };
  EXPECT_EQ(space(52'340'000'000), (Texts{{"52.3 GB free"}}));
  EXPECT_EQ(space(9'940'000'000), (Texts{{"9.9 GB free", OsdTone::warning}}));
  EXPECT_EQ(space(0), (Texts{{"0.0 GB free", OsdTone::alarm}}));
  rig.free_bytes.reset();
  EXPECT_TRUE(osd_page(rig, nullptr, {}).top_right.empty());
}

TEST(OsdWords, TrackingInTrouble) {
  PictureFacts picture = tracked();
  picture.tags = 1;
  picture.tracking_trouble = "tag 7: not where the set file says";
  OsdPage page = osd_page(in(live::Mode::live), &picture, pace);
  EXPECT_EQ(page.bottom_right.front(), (OsdText{"1 tag · ±0.83 mm", OsdTone::warning}));
  EXPECT_EQ(page.notices,
            (Texts{{"tracking: tag 7: not where the set file says", OsdTone::warning}}));

  picture = {};
  picture.tracking_trouble = "no tag in the picture";
  picture.untouched = "pose lost: no tag in the picture";
  page = osd_page(in(live::Mode::live), &picture, pace);
  EXPECT_EQ(page.bottom_left.front(), OsdText{"plate only"});
  EXPECT_EQ(page.bottom_right.front(), (OsdText{"tracking lost", OsdTone::alarm}));
  EXPECT_EQ(page.notices,
            (Texts{{"plate only: pose lost: no tag in the picture", OsdTone::warning}}));
}

TEST(OsdWords, FaultsInPlainWordsAndWhatAButtonDid) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  rig.look.state.camera_lost = true;
  const std::string moved = "card moved by +0.010 +0.000 +0.000 m";
  rig.news = {{report::Severity::info, "", moved}};
  EXPECT_EQ(osd_page(rig, &picture, pace).notices,
            (Texts{{"film camera: no picture", OsdTone::alarm}, {moved}}));
  rig.troubles = {report::lasting("film camera", "was unplugged; it is opened anew"),
                  report::passing("light camera", "is stalled")};
  rig.recorder_fault = "the disk is almost full";
  rig.lost = {.frames = 12, .shown = 0, .records = 3};
  rig.disk_silent_s = 5.2;
  rig.news.push_back({report::Severity::warning, "", "still recording; end the take first"});
  EXPECT_EQ(osd_page(rig, &picture, pace).notices,
            (Texts{{"film camera: was unplugged; it is opened anew", OsdTone::alarm},
                   {"light camera: is stalled", OsdTone::alarm},
                   {"recording ended: the disk is almost full", OsdTone::alarm},
                   {"disk not responding for 5 s", OsdTone::alarm},
                   {"missing from the take: 12 camera frames", OsdTone::alarm},
                   {"missing from the take: 3 tracking, button and event lines", OsdTone::alarm},
                   {moved},
                   {"still recording; end the take first", OsdTone::warning}}));
}

TEST(OsdWords, ADiskThatAnswersWithinTwoSecondsIsNoNews) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  rig.disk_silent_s = 1.9;
  EXPECT_TRUE(osd_page(rig, &picture, pace).notices.empty());
}

TEST(OsdWords, BeforeTheFirstPicture) {
  const OsdPage page = osd_page(in(live::Mode::live), nullptr, {});
  EXPECT_EQ(page.notices, (Texts{{"waiting for the film camera", OsdTone::warning}}));
  EXPECT_TRUE(page.bottom_left.empty());
}

fit::Figure figure_of(double median_px, double most_px, double shift_px) {
  fit::Figure figure;
  figure.off = {median_px, most_px, shift_px};
  return figure;
}

TEST(OsdWords, SayHowFarTheModelIsFromThePicture) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  const auto before = osd_page(rig, &picture, pace).bottom_right.size();
  rig.fit = figure_of(0.31, 0.84, 0.5);
  const OsdPage page = osd_page(rig, &picture, pace);
  ASSERT_EQ(page.bottom_right.size(), before + 1);
  EXPECT_EQ(page.bottom_right[1], OsdText{"model 0.3 px (90 % 0.8)"});
  EXPECT_TRUE(page.notices.empty());
}

TEST(OsdWords, AModelThatIsOffIsAlarming) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  const auto before = osd_page(rig, &picture, pace).bottom_right.size();
  for (const auto& [figure, words] :
       {std::pair{figure_of(0.3, 0.8, 8), "model off by 8.0 px: check phantom or tags"},
        {figure_of(2.1, 4, 0), "model off by 2.1 px: check phantom or tags"},
        {figure_of(9.96, 12, 12), "model off by 12 px: check phantom or tags"}}) {
    rig.fit = figure;
    const OsdPage page = osd_page(rig, &picture, pace);
    EXPECT_EQ(page.notices, (Texts{{words, OsdTone::alarm}}));
    EXPECT_EQ(page.bottom_right.size(), before);
  }
}

TEST(OsdWords, AThingThatIsOffIsNamedAndAlarming) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  const auto before = osd_page(rig, &picture, pace).bottom_right.size();
  rig.fit = figure_of(0.1, 4, 0);
  rig.fit->things_off = {{"red cube", 4.14, 20}};
  OsdPage page = osd_page(rig, &picture, pace);
  EXPECT_EQ(
      page.notices,
      (Texts{{"\"red cube\" off by 4.1 px: moved, or misplaced in the model", OsdTone::alarm}}));
  EXPECT_EQ(page.bottom_right.size(), before);
  rig.fit->things_off.push_back({"chair", 2.5, 20});
  rig.fit->things_off.push_back({"b\n", 2.5, 20});
  EXPECT_EQ(words_of(*rig.fit),
            "\"red cube\" off by 4.1 px: moved, or misplaced in the model; 2 other things off");
  // The last picture alone may show too few edges for a figure.
  rig.fit->things_off.resize(1);
  rig.fit->off.reset();
  rig.fit->why = "too few edges";
  EXPECT_EQ(osd_page(rig, &picture, pace).notices, page.notices);
}

TEST(OsdWords, SayWhyThereIsNoFigureOfTheModel) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  rig.fit.emplace().why = "too few edges";
  EXPECT_EQ(osd_page(rig, &picture, pace).notices, (Texts{{"model: no figure: too few edges"}}));
}

live::PassTimes times_of(std::vector<live::PassTimes::Pass> passes) {
  live::PassTimes times;
  times.is_timed = true;
  times.passes = std::move(passes);
  times.waited_ms = 12.34;
  return times;
}

TEST(OsdWords, ThePassesTimesStandInTheColumnWhileTheyAreAskedFor) {
  const PictureFacts picture = tracked();
  RigFacts rig = in(live::Mode::live);
  rig.pass_times = times_of({{"extend", 9.996}, {"shade", 6.1}, {"present", 0.042}});
  EXPECT_TRUE(osd_page(rig, &picture, pace).column.empty());
  rig.look.pass_times = true;
  EXPECT_EQ(osd_page(rig, &picture, pace).column, (Texts{{"graphics card: 16.1 ms per frame"},
                                                         {"computer waits: 12.3 ms"},
                                                         {"extend: 10.0 ms"},
                                                         {"shade: 6.10 ms"},
                                                         {"present: 0.04 ms"}}));
  rig.pass_times->is_of_rounds = true;
  EXPECT_EQ(osd_page(rig, &picture, pace).column.front(),
            OsdText{"graphics card: 16.1 ms per round"});
}

TEST(OsdWords, PassesBeyondTheSevenLongestAreSummed) {
  RigFacts rig = in(live::Mode::live);
  rig.look.pass_times = true;
  std::vector<live::PassTimes::Pass> passes;
  for (int i = 0; i < 8; ++i) passes.push_back({"pass " + std::to_string(i), 8.0 - i});
  rig.pass_times = times_of(passes);
  const Texts column = osd_page(rig, nullptr, {}).column;
  ASSERT_EQ(column.size(), 2u + 7 + 1);
  EXPECT_EQ(column.front(), OsdText{"graphics card: 36.0 ms per frame"});
  EXPECT_EQ(column[8], OsdText{"pass 6: 2.00 ms"});
  EXPECT_EQ(column.back(), OsdText{"1 other: 1.00 ms"});
  passes.push_back({"pass 8", 0.5});
  rig.pass_times = times_of(passes);
  EXPECT_EQ(osd_page(rig, nullptr, {}).column.back(), OsdText{"2 others: 1.50 ms"});
}

TEST(OsdWords, PassesWithoutTimes) {
  RigFacts rig = in(live::Mode::live);
  rig.look.pass_times = true;
  const auto column = [&] { return osd_page(rig, nullptr, {}).column; };
  EXPECT_EQ(column(), (Texts{{"graphics card: no frame timed yet"}}));
  rig.pass_times = live::PassTimes{};
  EXPECT_EQ(column(), (Texts{{"this computer does not time its passes"}}));
  rig.device = "llvmpipe (CPU)";
  EXPECT_EQ(column(), (Texts{{"llvmpipe (CPU) does not time its passes"}}));
  rig.pass_times = times_of({{"extend", 4}});
  rig.pass_times->untimed = 119.5;
  EXPECT_EQ(column().back(),
            (OsdText{"120 passes per frame could not be timed", OsdTone::warning}));
}

// The deviation of a place is the root of its three variances' sum.
TEST(OsdWords, FactsOfAShot) {
  pipeline::Shot shot;
  shot.samples = 4;
  shot.track.status = tracking::TrackStatus::tracked;
  shot.track.pose.emplace();
  shot.track.pose->tags = {1, 2, 5};
  const double variances_m2[] = {1, 1, 1, 4e-8, 4e-8, 1e-8};  // the first three are of rotation
  for (std::size_t axis = 0; axis < 6; ++axis)
    shot.track.pose->covariance[7 * axis] = variances_m2[axis];
  const PictureFacts facts = facts_of(shot);
  EXPECT_EQ(facts.tags, 3);
  EXPECT_NEAR(facts.deviation_mm, 0.3, 1e-12);
  EXPECT_EQ(facts.held_s, 0);
}

// A pose that is only expected is shown as such, with the reason that none was found.
TEST(OsdWords, ATrackingThatIsHeld) {
  pipeline::Shot shot;
  shot.samples = 4;
  shot.track.reason = "no tag in the picture";
  shot.shown_pose = tracking::ShownPose{glm::dmat4(1), {}, 0.32};
  const PictureFacts facts = facts_of(shot);
  const OsdPage page = osd_page(in(live::Mode::live), &facts, pace);
  EXPECT_EQ(page.bottom_right.at(0), (OsdText{"predicted pose 0.3 s", OsdTone::warning}));
  EXPECT_EQ(page.notices, (Texts{{"tracking: no tag in the picture", OsdTone::warning}}));
}

}  // namespace previz::rig::osd_test
