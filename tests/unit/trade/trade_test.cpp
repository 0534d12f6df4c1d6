// `previz trade` from end to end on a small take, on whatever Vulkan device there is.
#include "daemon/tools/trade/trade.hpp"

#include "daemon/core/set/load.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::trade::trade_test {

class Trade : public testing::Test {
 protected:
  Trade() { test::write_small_take(directory_.path()); }

  // 32x24, as little as a sweep can be.
  TradeOptions options() const {
    TradeOptions options;
    options.source.set_or_session = directory_ / "set.toml";
    options.directory = directory_ / "out";
    options.scale = 2.0 / 3;
    options.axes = {"estimator"};
    options.samples = {2, 1};
    options.reference_samples = 32;
    return options;
  }
  // Trades with options_; out_ has what this one said.
  TradeReport trade() {
    out_.str("");
    return run_trade(options_, out_);
  }
  void expect_refused(const std::function<void(TradeOptions&)>& change, const std::string& words) {
    options_ = options();
    change(options_);
    EXPECT_THAT(test::error_of([&] { trade(); }), HasSubstr(words));
  }
  void rewrite_set(const std::string& from, const std::string& to) {
    std::string text = test::content_of(directory_ / "set.toml");
    ASSERT_THAT(text, HasSubstr(from));
    text.replace(text.find(from), from.size(), to);
    std::ofstream(directory_ / "set.toml") << text;
  }
  void expect_no_files() const { EXPECT_TRUE(std::filesystem::is_empty(directory_ / "out")); }
  test::TemporaryDirectory directory_;
  TradeOptions options_ = options();
  std::ostringstream out_;
};

TEST_F(Trade, SweepsAndWritesTableAndPage) {
  const TradeReport report = trade();
  EXPECT_EQ(report.frame, 1u);  // frame 0 has no light yet
  EXPECT_EQ(report.width, 32);
  EXPECT_EQ(report.height, 24);
  ASSERT_GT(*report.noise.picture, 0.0);
  std::size_t entries = 0;
  for (const TradePlan::Axis& axis : report.plan.axes) entries += axis.entries.size();
  const std::string csv = test::content_of(report.csv);
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(csv, '\n')), 2 + 2 * entries);
  EXPECT_THAT(test::content_of(report.page), HasSubstr("What time buys on"));
  EXPECT_THAT(out_.str(), HasSubstr("round 3 of 3, estimator difference ("));

  for (const TradeMethod& method : report.methods) {
    ASSERT_EQ(method.points.size(), 2u);
    EXPECT_EQ(method.points[0].samples, 1);
    for (const TradePoint& point : method.points) {
      EXPECT_GT(point.seconds, 0.0);
      EXPECT_GT(*point.errors.picture, 0.0);
    }
    EXPECT_TRUE(method.bias);
  }
  ASSERT_FALSE(report.corners.empty());
  EXPECT_EQ(report.corners.front().at, front_of(report).front());
  EXPECT_EQ(report.corners.front().difference.width, 32);
}

// A rendering of half the size loses none of the camera's own detail, random in every pixel: a
// plate of independent pixels of standard deviation s, averaged by fours and enlarged, would be off
// by about s itself, a third of the brightness. What it loses is virtual detail, and no samples
// bring that back.
TEST_F(Trade, AHalfSizedRenderingStaysOffWhereThingsAreVirtual) {
  options_.axes = {"resolution"};
  const TradeReport report = trade();
  ASSERT_EQ(report.plan.methods[1].name, "resolution half");
  EXPECT_GT(report.methods[1].bias->value, 0.005);
  EXPECT_LT(report.methods[1].bias->value, 0.1);
  EXPECT_EQ(report.methods[0].bias->value, 0.0);
}

TEST_F(Trade, PartsThatNobodyNeedsChangeNoPixel) {
  options_.axes = {"parts"};
  options_.rounds = 1;
  const TradeReport report = trade();
  std::vector<std::string> carried;
  for (const TradeMethod& method : report.methods) {
    if (!method.changed_pixels) continue;
    carried.push_back(method.name);
    EXPECT_EQ(*method.changed_pixels, 0u) << method.name;
    EXPECT_FALSE(method.points.back().pareto) << "is no choice";
  }
  EXPECT_EQ(carried, (std::vector<std::string>{
                         "parts lens", "parts coloured gloss", "parts brushed metal", "parts cloth",
                         "parts lacquer", "parts refraction", "parts panes", "parts coloured glass",
                         "parts textures", "parts textures of layers", "parts texture mappings",
                         "parts vertex colours", "parts normal maps", "parts tangents",
                         "parts alpha", "parts lamps", "parts lamps in view", "parts many lamps"}));
}

// The take is not where the set's cameras are played from, as one that was copied is.
TEST_F(Trade, AnswersWithFilesThatRunAndRenderTake) {
  for (int camera = 0; camera < 2; ++camera)
    rewrite_set("device = \"session\"", "device = \"elsewhere\"");
  options_.source = {directory_ / "session", directory_ / "set.toml"};
  options_.answers = true;
  options_.fps = 2;
  options_.error = 0.5;
  const TradeReport report = trade();
  ASSERT_EQ(report.answers.size(), 3u);
  for (const TradeAnswer& answer : report.answers) {
    SCOPED_TRACE(answer.use + ": " + answer.words + "\n" + answer.toml);
    EXPECT_TRUE(answer.is_met);
    EXPECT_GT(answer.seconds, 0);
    EXPECT_EQ(answer.file, directory_ / "out" / (answer.use + ".toml"));
    const std::filesystem::path file = directory_ / "set.toml";
    const set::Set set = set::parse_set(test::content_of(file), file, {}, set::Origin::crew,
                                        set::read_overlay(answer.file));
    EXPECT_EQ(set.estimation.estimator, answer.settings.estimation.estimator);
    if (answer.use == "live") {
      EXPECT_EQ(answer.not_rehearsed, "");
      EXPECT_EQ(set.quality.fps, 2);
      EXPECT_LE(answer.seconds, 0.9 / 2);
      EXPECT_FALSE(set.quality.steps.empty());
    } else {
      EXPECT_EQ(set.quality.samples, answer.making.samples);
      EXPECT_EQ(set.quality.denoise, answer.making.denoise);
    }
  }
  EXPECT_THAT(test::content_of(report.page), HasSubstr("What you get"));
}

TEST_F(Trade, TakesASessionOrTheNewestTakeOfALiveSet) {
  const auto frame_of = [](const timing::FrameSource& source) {
    return timing::TimedFrame(source, {}).index();
  };
  EXPECT_EQ(frame_of({directory_ / "session"}), 1u);
  EXPECT_EQ(frame_of({directory_ / "session", directory_ / "set.toml"}), 1u);
  EXPECT_THROW(frame_of({directory_ / "set.toml", directory_ / "set.toml"}), Error);
  rewrite_set("driver = \"replay\"\ndevice = \"session\"", "driver = \"none\"");
  EXPECT_THROW(frame_of({directory_ / "set.toml"}), Error) << "it has no take";
  std::ofstream(directory_ / "set.toml", std::ios::app) << "\n[recording]\ndirectory = \".\"\n";
  EXPECT_EQ(frame_of({directory_ / "set.toml"}), 1u);
}

TEST_F(Trade, SharesAreWrittenInTwoWays) {
  EXPECT_DOUBLE_EQ(parse_share("2%"), 0.02);
  EXPECT_DOUBLE_EQ(parse_share("0.02"), 0.02);
  for (const char* wrong : {"", "%", "0", "-1%", "two", "2 %"})
    EXPECT_THROW(parse_share(wrong), Error) << wrong;
}

TEST_F(Trade, RefusesWhatCannotBeTraded) {
  expect_refused([](auto& o) { o.frame = test::small_take_lost; }, "frame 3: pose lost");
  expect_refused([](auto& o) { o.frame = test::small_take_unlit; }, "frame 0: no light frame");
  expect_refused([](auto& o) { o.frame = 80; }, "the last frame is 7");
  for (const double scale : {0.0, 1.5, std::nan("")})
    expect_refused([&](auto& o) { o.scale = scale; }, "must be above 0 and at most 1");
  expect_refused([&](auto& o) { o.directory = directory_ / "set.toml"; }, "is not a folder");
  expect_refused([](auto& o) { o.axes = {"colour"}; }, "--axes colour: unknown axis; estimator, ");
  expect_refused([](auto& o) { o.samples = {0}; }, "--samples 0: must be from 1");
  expect_refused([](auto& o) { o.reference_samples = 31; },
                 "--reference-samples 31: must be at least 32");
}

TEST_F(Trade, RefusesASetWithoutAReplayedCamera) {
  rewrite_set("driver = \"replay\"\ndevice = \"session\"", "driver = \"none\"");
  expect_refused([](auto&) {}, "observer: a trade needs a take; ");
}

TEST_F(Trade, RefusesAPictureWithNothingVirtualInIt) {
  const test::TemporaryDirectory bare;
  test::write_small_take(bare.path(), false);
  const auto of_bare_take = [&](TradeOptions& options) {
    options.source.set_or_session = bare / "set.toml";
    options.reference_samples = 32;
  };
  expect_refused(of_bare_take, "nothing virtual");
}

// A page of what is known by then: the reference at least.
TEST_F(Trade, AStopLeavesWhatIsKnown) {
  std::stop_source stop;
  stop.request_stop();
  options_.stop = stop.get_token();
  EXPECT_TRUE(trade().interrupted);
  expect_no_files();

  options_.stop = {};
  options_.axes = {"resolution"};
  trade();
  options_.stop = stop.get_token();
  options_.axes = {"estimator"};
  const TradeReport report = trade();
  EXPECT_TRUE(report.interrupted);
  const std::string page = test::content_of(report.page);
  EXPECT_THAT(page, HasSubstr("It was stopped before it had ended"));
  EXPECT_THAT(page, HasSubstr("There was no time to measure: "));
  EXPECT_THAT(page, HasSubstr("<b>converged</b>"));
  EXPECT_TRUE(report.answers.empty());
}

// With a picture of few samples to measure against, nothing would be right.
TEST_F(Trade, MeasuresNothingWithoutTimeForAReference) {
  options_.minutes = 1e-5;
  options_.answers = true;
  EXPECT_THAT(
      test::error_of([&] { trade(); }),
      AllOf(StartsWith("--minutes 1e-05: "), HasSubstr(" of 32 samples or more"),
            HasSubstr("nothing was measured"), HasSubstr("Give --minutes 1, or --scale 0.")));
  expect_no_files();
}

// Whatever the time, the set's own settings are measured and judged; the rest is named.
TEST_F(Trade, TakesTheTimeThatItIsGiven) {
  options_.rounds = 1;
  options_.axes = {"resolution"};
  trade();  // so that there is a reference
  options_ = options();
  options_.minutes = 1e-5;
  options_.answers = true;
  options_.fps = 1e-3;
  const TradeReport report = trade();
  EXPECT_FALSE(report.interrupted);
  ASSERT_FALSE(report.methods.front().points.empty());
  EXPECT_EQ(report.unmeasured.size(), report.methods.size() - 1);
  ASSERT_EQ(report.answers.size(), 3u);
  for (const TradeAnswer& answer : report.answers) {
    EXPECT_FALSE(answer.is_whole) << answer.use;
    EXPECT_THAT(answer.words, HasSubstr("no time to try all settings"));
    EXPECT_EQ(answer.file.empty(), !answer.is_met);
  }
  const std::string csv = test::content_of(report.csv);
  EXPECT_THAT(csv, HasSubstr("estimator,"));
  const auto count = std::ranges::count(csv, '\n');
  // The heads, the reference, and the set's own settings on each axis.
  EXPECT_EQ(count, 2 + 2 * std::ptrdiff_t(report.plan.axes.size())) << csv;
  EXPECT_THAT(out_.str(), HasSubstr(", within "));
}

// The second trade of the same frame and set measures only what the first did not: no method, and
// with a reference that is whole no sample of it. Another depth is another picture.
TEST_F(Trade, GoesOnFromItsLastTable) {
  options_.rounds = 1;
  const TradeReport first = trade();
  const TradeReport second = trade();
  EXPECT_THAT(out_.str(), HasSubstr("continuing the last table"));
  EXPECT_THAT(out_.str(), Not(HasSubstr("round 1 of 1")));
  EXPECT_EQ(second.reference_samples, first.reference_samples);
  for (std::size_t m = 0; m < first.methods.size(); ++m)
    for (std::size_t i = 0; i < first.methods[m].points.size(); ++i) {
      EXPECT_EQ(second.methods[m].points[i].seconds, first.methods[m].points[i].seconds);
      EXPECT_EQ(second.methods[m].points[i].errors.picture,
                first.methods[m].points[i].errors.picture);
    }

  options_.rounds = 2;
  *options_.reference_samples *= 2;
  const TradeReport third = trade();
  EXPECT_EQ(third.reference_samples, 2 * first.reference_samples);
  EXPECT_THAT(out_.str(), Not(HasSubstr("round 1 of 2")));
  EXPECT_THAT(out_.str(), HasSubstr("round 2 of 2"));

  rewrite_set("[quality]", "[estimator]\nmax_depth = 3\n\n[quality]");
  trade();
  EXPECT_THAT(out_.str(), HasSubstr("measuring everything again"));
  EXPECT_THAT(out_.str(), HasSubstr("round 1 of 2"));
}

TEST_F(Trade, ADamagedMemoryIsSaidAndNotUsed) {
  options_.rounds = 1;
  trade();
  const std::filesystem::path reference = directory_ / "out" / "reference.bin";
  std::filesystem::resize_file(reference, std::filesystem::file_size(reference) / 2);
  trade();
  EXPECT_THAT(out_.str(), HasSubstr("it ends early; measuring everything again"));
  std::ofstream(directory_ / "out" / "trade.json") << "{]";
  EXPECT_NO_THROW(trade());
  EXPECT_THAT(out_.str(), HasSubstr("measuring everything again"));
}

}  // namespace previz::trade::trade_test
