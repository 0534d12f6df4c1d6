// The search for settings, on simulated costs and errors.
#include "daemon/tools/trade/answer.hpp"

#include "tests/support/test.hpp"

namespace previz::trade::answer_test {

TEST(TradeAnswer, StepsAreThoseThatNoOtherBeats) {
  const std::vector<TradeStep> best = best_steps({{{1, 1, true}, 0.030, 0.08},
                                                  {{4, 1, true}, 0.060, 0.05},
                                                  {{1, 1, false}, 0.025, 0.20},
                                                  {{4, 0.5, true}, 0.020, 0.07},
                                                  {{1, 0.25, true}, 0.008, 0.30}});
  ASSERT_EQ(best.size(), 3u);
  EXPECT_EQ(best[0].making, (timing::Making{4, 1, true}));
  EXPECT_EQ(best[1].making,
            (timing::Making{4, 0.5, true}));  // cheaper and nearer than one of the whole
  EXPECT_EQ(best[2].making, (timing::Making{1, 0.25, true}));
}

TEST(TradeAnswer, ManyStepsAreThinnedAndKeepTheirEnds) {
  std::vector<TradeStep> all;
  for (int i = 0; i < 30; ++i) all.push_back({{30 - i, 1, true}, std::pow(0.9, i), 0.01 * (i + 1)});
  const std::vector<TradeStep> best = best_steps(all);
  EXPECT_EQ(best.size(), 8u);
  EXPECT_EQ(best.front().making.samples, 30);
  EXPECT_EQ(best.back().making.samples, 1);
}

// error^2 = 0.01^2 + 0.08^2 / samples.
ErrorCurve levelling_curve(int most) {
  ErrorCurve curve;
  for (int samples = 1; samples <= most; samples *= 2)
    curve.add(samples, {1e-4 + 0.0064 / samples, 1e-6});
  return curve;
}

TEST(ErrorCurve, SamplesForAnErrorFollowBeyondWhatWasMeasured) {
  const ErrorCurve curve = levelling_curve(16);
  EXPECT_NEAR(curve.samples_for(0.02, 1 << 16, false), 22, 1);  // 0.0064 / (4e-4 - 1e-4)
  EXPECT_EQ(curve.samples_for(0.009, 1 << 16, false), 0) << "below the bias";
  EXPECT_EQ(curve.samples_for(0.5, 1 << 16, false), 1);
  EXPECT_NEAR(curve.squared(64, false).value, 1e-4 + 1e-4, 1e-9);
  // Without a bias the rest is noise: 5e-4 at 16 samples.
  EXPECT_NEAR(curve.squared(64, true).value, 1.25e-4, 1e-9);
}

TEST(ErrorCurve, BetweenPointsIsAPowerOfTheSamples) {
  ErrorCurve curve;
  curve.add(1, {1, 0});
  curve.add(4, {0.25, 0});
  EXPECT_NEAR(curve.squared(2, false).value, 0.5, 1e-12);
  EXPECT_EQ(curve.squared(4, false).value, 0.25);
}

// What is rare shows with many samples only: the long curve falls slower than 1 / samples from
// there on. Twice its squares and a bias of 0.1, seen with few samples, go on in the same way.
TEST(ErrorCurve, GoesOnAsALongerCurveDoes) {
  const auto heavy = [](int samples) { return std::pow(samples, -0.6); };
  ErrorCurve own, other;
  for (int samples = 1; samples <= 1024; samples *= 2) own.add(samples, {heavy(samples), 1e-9});
  for (int samples = 1; samples <= 32; samples *= 2)
    other.add(samples, {0.01 + 2 * heavy(samples), 1e-9});
  other.extend(own);
  EXPECT_EQ(other.points().back().samples, 1024);
  EXPECT_NEAR(other.squared(1024, false).value, 0.01 + 2 * heavy(1024), 1e-6);
}

TEST(ErrorCurve, WithNothingInCommonStaysAsItIs) {
  ErrorCurve own, other;
  own.add(3, {1, 0});
  other.add(1, {1, 0});
  other.extend(own);
  EXPECT_EQ(other.points().size(), 1u);
}

// Noise of 0.4 at one sample, and a time of 10 ms a sample, but for what settings change. A
// rehearsal takes `slower` times as long.
class Simulated {
 public:
  TradeProbe probe(double slower = 1) {
    TradeProbe probe;
    probe.error = [this](const timing::FrameSettings& s, const timing::Making& m, bool) {
      asked_.push_back(s);
      return SquaredError{0.16 / m.samples / m.scale, 1e-4};
    };
    probe.curves = [](const timing::FrameSettings&, double) {
      StillCurves curves;
      for (int samples = 1; samples <= 64; samples *= 2) {
        curves.noisy.add(samples, {0.16 / samples, 1e-5});
        curves.denoised.add(samples, {0.01 + 0.04 / samples, 1e-5});
      }
      return curves;
    };
    probe.gain = [this](const timing::FrameSettings& s, bool) {
      return s.estimation.max_depth == hopeless_ ? 0.1 : 1.0;
    };
    probe.cost = [](const timing::FrameSettings&, bool) {
      return timing::PathCost(0.002, 0.01, 0.001);
    };
    probe.rehearse = [this, slower](const set::Set& set) {
      rehearsed_.push_back(set);
      // As the governor: the first step that fits, else the last.
      Rehearsal shown;
      for (const set::PreviewStep& step : set.quality.steps) {
        shown.making = {step.samples, step.scale, step.denoise.value_or(true)};
        shown.frame_s = slower * timing::PathCost(0.002, 0.01, 0.001).seconds(shown.making);
        if (shown.frame_s <= 0.9 / set.quality.fps) break;
      }
      shown.fps = std::min(1 / shown.frame_s, set.quality.fps);
      return shown;
    };
    probe.take_fps = 25;
    probe.step = [](const std::string&) {};
    probe.limit = [](std::optional<TradePhase>) {};
    return probe;
  }
  std::vector<timing::FrameSettings> asked_;
  std::vector<set::Set> rehearsed_;
  int hopeless_ = -1;
};

TEST(TradeAnswer, IsWhatARehearsalShows) {
  Simulated simulated;
  const auto answers = answer({25, 0.1}, {}, {}, {}, simulated.probe());
  EXPECT_EQ(simulated.rehearsed_.size(), 1u);
  EXPECT_TRUE(answers[0].is_met) << answers[0].words;
  EXPECT_EQ(answers[0].shown_fps, 25);
  EXPECT_LE(answers[0].seconds, 0.04);
}

// Beside tracking and lighting a frame takes five times as long: what was best for many samples is
// not for few, so the settings are searched again with that.
TEST(TradeAnswer, IsPlannedAnewWhereFramesTakeLonger) {
  Simulated simulated;
  const auto answers = answer({25, 0.1}, {}, {}, {}, simulated.probe(5));
  ASSERT_EQ(simulated.rehearsed_.size(), 2u);
  EXPECT_TRUE(answers[0].is_met) << answers[0].words;
  EXPECT_LE(answers[0].seconds, 0.04);
  // Steps that take longer than four frames are of no use: 16 samples of half the pixels take 0.08
  // s alone and 0.4 s here.
  EXPECT_LT(simulated.rehearsed_.back().quality.steps.front().scale,
            simulated.rehearsed_.front().quality.steps.front().scale);
}

TEST(TradeAnswer, SaysTheRateThatIsShownWhereNoneHolds) {
  Simulated simulated;
  const auto answers = answer({25, 0.1}, {}, {}, {}, simulated.probe(1000));
  EXPECT_FALSE(answers[0].is_met);
  EXPECT_THAT(answers[0].words,
              HasSubstr("more than this machine can do beside tracking and lighting"));
}

TEST(TradeAnswer, SaysWhyARehearsalShowedNothing) {
  Simulated simulated;
  TradeProbe probe = simulated.probe();
  const auto words_after = [&](const std::string& why_not) {
    probe.rehearse = [&](const set::Set&) { return Rehearsal{0, 0, {}, why_not}; };
    return answer({25, 0.1}, {}, {}, {}, probe)[0].words;
  };
  using testing::EndsWith;
  EXPECT_THAT(words_after("light: lights.mkv: no frame can be read"),
              EndsWith("its rehearsal failed: light: lights.mkv: no frame can be read"));
  EXPECT_THAT(words_after(""),
              EndsWith("there was no time to rehearse it beside tracking and lighting"));
}

// Denoised pictures never get below 0.1 by their bias; noisy ones reach 0.05 with 64 samples.
TEST(TradeAnswer, TakesNoiseForABias) {
  Simulated simulated;
  const auto answers = answer({25, 0.05}, {}, {}, {}, simulated.probe());
  EXPECT_TRUE(answers[2].is_met);
  EXPECT_FALSE(answers[2].making.denoise);
  EXPECT_EQ(answers[2].making.samples, 64);
  EXPECT_NEAR(answers[2].seconds, 0.002 + 0.64, 1e-9);
}

TEST(TradeAnswer, DoesNotTryWhatWasWorseAlone) {
  Simulated simulated;
  simulated.hopeless_ = 2;
  const TradeAxis depth{"depth",
                        "",
                        {{"2", [](timing::FrameSettings& s) { s.estimation.max_depth = 2; }},
                         {"4", [](timing::FrameSettings& s) { s.estimation.max_depth = 4; }}},
                        ""};
  answer({25, 0.1}, {}, {}, {depth}, simulated.probe());
  std::set<int> depths;
  for (const timing::FrameSettings& asked : simulated.asked_)
    depths.insert(asked.estimation.max_depth);
  EXPECT_THAT(depths, AllOf(Contains(4), Not(Contains(2))));
}

}  // namespace previz::trade::answer_test
