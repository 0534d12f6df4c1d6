// `previzd render` and `previzd run` from end to end on a small take, on whatever Vulkan device
// there is (Mesa's CPU driver where there is no GPU).
#include "daemon/post/render.hpp"

#include <nlohmann/json.hpp>

#include "daemon/output/exr.hpp"
#include "daemon/output/png.hpp"
#include "daemon/pipeline/preview_size.hpp"
#include "daemon/rig/live.hpp"
#include "drivers/plate.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::post::render_test {

using test::small_take_frame;
using test::small_take_frames;
using test::small_take_lost;
using test::small_take_unlit;

class RenderSession : public testing::Test {
 protected:
  RenderReport render(RenderOptions options) {
    options.session = directory_ / "session";
    if (!options.directory) options.directory = directory_ / "out";
    out_.str("");
    return render_session(options, out_);
  }
  rig::LiveOptions live_options() const {
    rig::LiveOptions options;
    options.set_file = directory_ / "set.toml";
    options.directory = directory_ / "live";
    return options;
  }
  // Requests the stop when the condition holds, and, with a failure, when it never does. The thread
  // ends with the scope it is kept in, also where what it waits for never comes.
  static std::jthread stop_when(const std::string& what, const std::function<bool()>& condition,
                                const std::stop_source& stop) {
    return std::jthread([=](const std::stop_token& left) mutable {
      const auto result =
          test::wait_until(what, [&] { return left.stop_requested() || condition(); });
      EXPECT_TRUE(result);
      stop.request_stop();
    });
  }
  static bool is_plate(const std::filesystem::path& png, int frame) {
    return output::read_png(png).samples == to_plate(small_take_frame(frame)).samples;
  }
  test::TemporaryDirectory directory_;
  std::ostringstream out_;
  report::Reports reports_{report::lines_to(out_)};
};

// The row that the card's middle is in, by its mask.
double row_of_the_card(const render::Layers& layers) {
  double rows = 0, covered = 0;
  for (int y = 0; y < layers.height; ++y)
    for (int x = 0; x < layers.width; ++x) {
      const double mask = layers.mask[static_cast<std::size_t>(y * layers.width + x)];
      rows += mask * y;
      covered += mask;
    }
  return rows / covered;
}

// From frame to frame the camera goes 0.01 m along the picture's up: at f = 40 px a card 0.9 m away
// goes down by 40 * 0.01 / 0.9 px. It is 13 px wide; with 2 samples a pixel the mask of the 52
// pixels at its border deviates by at most 0.5 / sqrt(2), 6.5 px from its middle, which makes
// sqrt(52) * 6.5 * 0.35 / 169 = 0.1 px.
TEST_F(RenderSession, EveryFrameHasItsFilesAndItsRecord) {
  test::write_small_take(directory_.path());
  const RenderReport report = render({});
  ASSERT_EQ(report.frames.size(), std::size_t{small_take_frames});
  EXPECT_FALSE(report.interrupted);
  EXPECT_TRUE(std::filesystem::exists(report.video));
  for (int i = 0; i < small_take_frames; ++i) {
    const FinishedFrame& record = report.frames[i];
    const std::string number = "000" + std::to_string(i);
    const render::Layers layers = output::read_exr(directory_ / ("out/" + number + ".exr"));
    EXPECT_EQ(layers.width, 48);
    EXPECT_EQ(record.timestamp_ns, small_take_frame(i).timestamp_ns);
    const bool untouched = i == small_take_lost || i == small_take_unlit;
    EXPECT_EQ(record.status == FrameStatus::untouched, untouched) << record.reason;
    EXPECT_EQ(layers.samples, untouched ? 0 : 2);
    if (!untouched) {
      EXPECT_NEAR(row_of_the_card(layers), 17.5 + i * 40 * 0.01 / 0.9, 4 * 0.1) << i;
    }
    EXPECT_EQ(is_plate(directory_ / ("out/" + number + ".png"), i), untouched);
    EXPECT_EQ(record.counters.dropped_not_finite, 0u);
    EXPECT_EQ(record.counters.dropped_negative, 0u);
    EXPECT_EQ(record.counters.stopped_in_layers, 0u);
  }
  EXPECT_THAT(report.frames[small_take_lost].reason, HasSubstr("pose lost"));
  EXPECT_THAT(report.frames[small_take_unlit].reason, HasSubstr("light"));
  EXPECT_THAT(out_.str(), HasSubstr("plate untouched"));
  EXPECT_EQ(report.frames.back().light_frames.size(), 3u);  // one of each exposure
}

// 0.3 m at 0.9 m and f = 40 px is 13 px wide: the card covers the middle of the picture.
TEST_F(RenderSession, TheVirtualCardCoversThePlateAndTheRestShowsIt) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{1, 1};
  options.denoise = false;
  render::Layers seen;
  options.on_frame = [&](const pipeline::Shot& shot) { seen = *shot.layers; };
  render(options);
  const std::size_t middle = 18 * 48 + 24;
  EXPECT_EQ(seen.mask[middle], 1.0f);
  EXPECT_NEAR(seen.depth[middle], 0.9f, 1e-3f);
  EXPECT_GT(seen.composite[middle].g, 0.0f);
  EXPECT_EQ(seen.mask[0], 0.0f);
  EXPECT_EQ(seen.composite[middle], seen.mixed[middle]);
}

TEST_F(RenderSession, AnAdaptivePictureSaysSoAndIsNoOther) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{1, 1};
  options.samples = 64;
  options.adaptive = true;
  std::vector<pipeline::Shot> shots;
  options.on_frame = [&](const pipeline::Shot& shot) { shots.push_back(shot); };
  render(options);
  EXPECT_THAT(out_.str(), HasSubstr("64 samples on average"));
  EXPECT_GT(shots.at(0).samples, 64);  // where it was noisy
  EXPECT_EQ(shots.at(0).samples, shots.at(0).layers->samples);
  options.adaptive = false;
  EXPECT_THROW(render(options), Error);  // what is there already was made otherwise
  options.samples = 16;
  options.adaptive = options.force = true;
  render(options);
  EXPECT_THAT(out_.str(), HasSubstr("16 samples, the same for every pixel"));
}

TEST_F(RenderSession, ADenoisedPictureSaysSoAndItsOtherLayersAreAsRendered) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{1, 1};
  std::vector<render::Layers> seen;
  options.on_frame = [&](const pipeline::Shot& shot) { seen.push_back(*shot.layers); };
  options.denoise = false;
  render(options);
  const Plate noisy = output::read_png(directory_ / "out/0001.png");
  options.denoise = true;
  options.neighbours = 0;
  EXPECT_THROW(render(options), Error);  // what is there already was made otherwise
  options.force = true;
  render(options);
  EXPECT_THAT(out_.str(), HasSubstr("2 samples, denoised"));
  EXPECT_NE(output::read_png(directory_ / "out/0001.png").samples, noisy.samples);
  EXPECT_NE(seen.at(1).composite, seen.at(0).composite);
  EXPECT_EQ(seen.at(1).mixed, seen.at(0).mixed);
  EXPECT_EQ(seen.at(1).diff, seen.at(0).diff);
}

// Of the light camera's frames nothing is used: the frame before the first of them is lit too, by
// ten times the light's red as of the others.
TEST_F(RenderSession, TheRecordedLightLightsEveryFrame) {
  session::CapturedLight light{{{1, {0, 0, 1}, 0.01, {10, 1, 1}}}, 1, {{0, 0, 0}}};
  test::write_small_take(directory_.path(), true,
                         "[lighting]\nmode = \"sources\"\nfrom = \"recording\"\n", light);
  render::Layers seen;
  RenderOptions options;
  options.frames = FrameRange{small_take_unlit, small_take_unlit};
  options.on_frame = [&](const pipeline::Shot& shot) { seen = *shot.layers; };
  const RenderReport report = render(options);
  EXPECT_EQ(report.frames.front().status, FrameStatus::rendered);
  const glm::vec3 card = seen.mixed[18 * 48 + 24];
  EXPECT_GT(card.g, 0);
  EXPECT_NEAR(card.r / card.g, 10, 1e-4);
  ASSERT_EQ(report.frames.front().light_sources.size(), 1u);
  EXPECT_EQ(report.frames.front().light_sources[0].flux.r, 10);
}

// The lamp above is dimmed to a third: its light falls by two thirds on the virtual card and on the
// real floor, and goes altogether with gain 0. By the same random numbers everything is linear in
// the gain, to single precision's rounding of sums of a few samples.
TEST_F(RenderSession, ACapturedLampIsDimmedOnVirtualAndRealSurfaces) {
  const session::CapturedLight light{
      {{1, {0, 0, 1}, 0.01, {10, 5, 2}}, {2, {0.8, 0, 0.6}, 0.01, {1, 1, 1}}}, 1, {{0, 0, 0}}};
  struct Seen {
    glm::dvec3 card, floor, floor_difference;
  };
  const auto seen = [&](const std::string& captured) {
    const test::TemporaryDirectory folder;
    test::write_small_take(folder.path(), true,
                           "[lighting]\nmode = \"sources\"\nfrom = \"recording\"\n" + captured,
                           light);
    Seen result;
    RenderOptions options;
    options.session = folder / "session";
    options.directory = folder / "out";
    options.frames = FrameRange{small_take_unlit, small_take_unlit};
    options.on_frame = [&](const pipeline::Shot& shot) {
      const std::size_t card = 18 * 48 + 24, floor = 3 * 48 + 4;
      EXPECT_EQ(shot.layers->mask[floor], 0);
      result = {shot.layers->mixed[card], shot.layers->mixed[floor], shot.layers->diff[floor]};
    };
    render_session(options, out_);
    return result;
  };
  const std::string window =
      "[[captured_light]]\nname = \"window\"\ndirection = [0.02, 0, 1]\ncone_deg = 5\n";
  const Seen plain = seen(""), declared = seen(window), off = seen(window + "gain_mixed = 0\n"),
             third = seen(window + "gain_mixed = 0.33\n");
  for (int c = 0; c < 3; ++c) {
    const auto expect = [](double found, double expected) {
      EXPECT_NEAR(found, expected, 1e-5 * std::abs(expected) + 1e-6);
    };
    expect(declared.card[c], plain.card[c]);
    expect(declared.floor_difference[c], 0);
    const double lamp = declared.card[c] - off.card[c];
    EXPECT_GT(lamp, 0.3 * declared.card[c]);
    expect(third.card[c], off.card[c] + 0.33 * lamp);
    expect(off.floor_difference[c], off.floor[c] - declared.floor[c]);
    EXPECT_LT(off.floor_difference[c], 0);
    expect(third.floor_difference[c], 0.67 * off.floor_difference[c]);
  }
}

// A take may be lit by what its set says alone, whatever the light camera saw.
TEST_F(RenderSession, TheSetsOwnLightLightsEveryFrame) {
  test::write_small_take(directory_.path(), true,
                         "[lighting]\nfrom = \"set\"\n[[light]]\ntype = \"directional\"\n"
                         "direction = [0, 0, -1]\nemission = [3, 2, 1]\ngain_real = 1\n");
  render::Layers seen;
  RenderOptions options;
  options.frames = FrameRange{small_take_unlit, small_take_unlit};
  options.on_frame = [&](const pipeline::Shot& shot) { seen = *shot.layers; };
  EXPECT_EQ(render(options).frames.front().status, FrameStatus::rendered);
  const glm::vec3 card = seen.mixed[18 * 48 + 24];
  EXPECT_NEAR(card.r / card.b, 3, 1e-4);
}

TEST_F(RenderSession, WithNothingVirtualEveryPictureIsThePlateBitForBit) {
  test::write_small_take(directory_.path(), false);
  render({});
  for (int i = 0; i < small_take_frames; ++i)
    EXPECT_TRUE(is_plate(directory_ / ("out/000" + std::to_string(i) + ".png"), i)) << i;
}

TEST_F(RenderSession, ASecondRunSkipsWhatIsFinishedAndOtherSamplesAreRefused) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{0, 2};
  EXPECT_EQ(render(options).found_finished, 0u);
  int rendered = 0;
  options.frames.reset();
  options.on_frame = [&](const pipeline::Shot&) { ++rendered; };
  const RenderReport second = render(options);
  EXPECT_EQ(second.found_finished, 3u);
  EXPECT_EQ(rendered, small_take_frames - 3);
  EXPECT_EQ(second.frames.size(), std::size_t{small_take_frames});
  options.samples = 4;
  EXPECT_THROW(render(options), Error);
  options.force = true;
  EXPECT_EQ(render(options).found_finished, 0u);
}

// 24 x 18 of the 48 x 36 pixels: to look at a take quickly. It is another picture, not the same.
TEST_F(RenderSession, ASmallerPictureIsAnotherOne) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{small_take_lost, small_take_lost + 1};
  options.scale = 0.5;
  const RenderReport report = render(options);
  ASSERT_EQ(report.frames.size(), 2u);
  for (const char* name : {"0003", "0004"}) {
    EXPECT_EQ(output::read_png(directory_ / ("out/" + std::string(name) + ".png")).width, 24);
    const render::Layers layers =
        output::read_exr(directory_ / ("out/" + std::string(name) + ".exr"));
    EXPECT_EQ(layers.width, 24);
    EXPECT_EQ(layers.height, 18);
  }
  options.scale = 1;
  try {
    render(options);
    FAIL() << "pictures of two sizes in one folder";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("scale is 0.5 there and 1.0 now"));
  }
}

TEST_F(RenderSession, AStopLeavesWholeFramesAndTheNextRunEndsInTheSamePictures) {
  test::write_small_take(directory_.path());
  RenderOptions whole;
  whole.directory = directory_ / "whole";
  render(whole);

  std::stop_source stop;
  RenderOptions options;
  options.stop = stop.get_token();
  options.on_frame = [&](const pipeline::Shot& shot) {
    if (shot.index == 1) stop.request_stop();
  };
  const RenderReport stopped = render(options);
  EXPECT_TRUE(stopped.interrupted);
  EXPECT_TRUE(stopped.video.empty());
  EXPECT_LT(stopped.frames.size(), std::size_t{small_take_frames});
  EXPECT_GE(stopped.frames.size(), 2u);

  const RenderReport resumed = render({});
  EXPECT_EQ(resumed.found_finished, stopped.frames.size());
  ASSERT_EQ(resumed.frames.size(), std::size_t{small_take_frames});
  for (int i = 0; i < small_take_frames; ++i) {
    const std::string name = "000" + std::to_string(i) + ".png";
    EXPECT_EQ(output::read_png(directory_ / ("out/" + name)).samples,
              output::read_png(directory_ / ("whole/" + name)).samples);
  }
}

// The light is averaged over time and filled with what the film camera saw: a render that starts
// late, or goes on, has the light of one that did not.
TEST_F(RenderSession, TheLightOfAFrameIsTheSameWhereverTheRenderStarts) {
  test::write_small_take(directory_.path(), true,
                         "[lighting]\nunseen = \"observer\"\nsmoothing_s = 5\n");
  std::map<std::uint64_t, std::vector<glm::vec3>> whole, late;
  RenderOptions options;
  options.on_frame = [&](const pipeline::Shot& shot) {
    if (shot.light) whole[shot.index] = shot.light->lighting.environment.radiance;
  };
  render(options);
  options.on_frame = [&](const pipeline::Shot& shot) {
    late[shot.index] = shot.light->lighting.environment.radiance;
  };
  options.frames = FrameRange{5, 6};
  options.directory = directory_ / "late";
  const RenderReport report = render(options);
  EXPECT_EQ(report.frames.size(), 2u);
  ASSERT_EQ(late.size(), 2u);
  EXPECT_TRUE(late[5] == whole[5] && late[6] == whole[6]);
  EXPECT_FALSE(whole[5] == whole[6]);  // every picture of the film camera changes the fill
}

TEST_F(RenderSession, AnotherSetFileTakesTheSessionsAssetsWhereItHasNoOwn) {
  test::write_small_take(directory_.path());
  std::filesystem::create_directory(directory_ / "elsewhere");
  std::filesystem::rename(directory_ / "set.toml", directory_ / "elsewhere/tweaked.toml");
  RenderOptions options;
  options.set_file = directory_ / "elsewhere/tweaked.toml";
  options.frames = FrameRange{1, 1};
  EXPECT_EQ(render(options).frames.size(), 1u);
}

// The set of a take from elsewhere does not choose a folder to write into; the crew does.
TEST_F(RenderSession, ATakesOwnSetWritesNowhereElse) {
  const std::filesystem::path elsewhere = directory_ / "elsewhere";
  test::write_small_take(directory_.path(), true,
                         "[output]\ndirectory = \"" + elsewhere.string() + "\"\n");
  RenderOptions options;
  options.session = directory_ / "session";
  options.frames = FrameRange{1, 1};
  EXPECT_THROW(render_session(options, out_), Error);
  EXPECT_FALSE(std::filesystem::exists(elsewhere));
  options.any_paths = true;
  EXPECT_EQ(render_session(options, out_).directory, elsewhere);
}

TEST_F(RenderSession, ARangeBehindTheEndIsRefused) {
  test::write_small_take(directory_.path());
  RenderOptions options;
  options.frames = FrameRange{80, 90};
  EXPECT_THROW(render(options), Error);
}

// Live: nothing vanishes. Every frame of the camera was shown or is counted as dropped, with cause.
TEST_F(RenderSession, LiveAccountsForEveryFrame) {
  test::write_small_take(directory_.path());
  const pipeline::MetricsSnapshot snapshot = rig::run_live(live_options(), reports_);
  std::uint64_t accounted = snapshot.stages.at("display").frames;
  for (const auto& [name, stage] : snapshot.stages)
    for (const auto& [cause, frames] : stage.dropped) accounted += frames;
  EXPECT_EQ(accounted, std::uint64_t{small_take_frames});
  EXPECT_GT(snapshot.latency_p50_s, 0.003);  // at least the device's own 3 ms
  EXPECT_GE(snapshot.latency_p99_s, snapshot.latency_p50_s);
  EXPECT_EQ(output::read_png(directory_ / "live/picture.png").width, 48);
  std::ifstream metrics(directory_ / "live/metrics.json");
  EXPECT_EQ(nlohmann::json::parse(metrics)["stages"]["observer"]["frames"], small_take_frames);
}

// `previzd run --spp N`.
TEST_F(RenderSession, LiveTakesTheSamplesItIsAskedFor) {
  test::write_small_take(directory_.path());  // whose set says 2
  rig::LiveOptions options = live_options();
  options.samples = 3;
  options.loop = true;
  std::stop_source stop;
  options.stop = stop.get_token();
  std::atomic<bool> rendered = false;
  std::set<int> samples;  // of the pictures that were rendered whole
  options.on_shown = [&](const pipeline::Shot& shot, const rig::Look&) {
    if (!shot.whole || !shot.untouched.empty()) return;
    samples.insert(shot.samples);
    rendered = true;
  };
  const auto is_rendered = [&] { return rendered.load(); };
  const auto stopper = stop_when("a picture is rendered", is_rendered, stop);
  rig::run_live(options, reports_);
  EXPECT_EQ(samples, std::set<int>{3});
}

// quality.scale is of the preview only.
TEST_F(RenderSession, LiveShowsThePreviewAtTheSetsScaleAndOfflineIsFullSize) {
  test::write_small_take(directory_.path(), false, "scale = 0.5\n");
  rig::run_live(live_options(), reports_);
  const Plate last = to_plate(small_take_frame(small_take_frames - 1));
  const Plate half = pipeline::scaled(last, 0.5, lighting::Response(ResponseCurve{}, 8));
  const Plate shown = output::read_png(directory_ / "live/picture.png");
  EXPECT_EQ(shown.width, 24);
  EXPECT_EQ(shown.samples, half.samples);  // nothing is virtual: the plate, bit for bit

  RenderOptions offline;
  offline.frames = FrameRange{1, 1};
  render(offline);
  EXPECT_TRUE(is_plate(directory_ / "out/0001.png", 1));
}

TEST_F(RenderSession, LiveFillsTheLightFromTheFilmCamera) {
  test::write_small_take(directory_.path(), true, "[lighting]\nunseen = \"observer\"\n");
  std::stop_source stop;
  rig::LiveOptions options = live_options();
  options.loop = true;
  options.stop = stop.get_token();
  std::atomic<bool> lit = false;
  options.on_shown = [&](const pipeline::Shot& shot, const rig::Look&) {
    if (shot.light) lit = true;
  };
  const auto is_lit = [&] { return lit.load(); };
  const auto stopper = stop_when("a picture has light", is_lit, stop);
  const pipeline::MetricsSnapshot metrics = rig::run_live(options, reports_);
  EXPECT_GT(metrics.stages.at("lighting").frames, 0u);
  EXPECT_THAT(out_.str(), HasSubstr("filled by the rule \"observer\""));
}

TEST_F(RenderSession, LiveStopsWhenAsked) {
  test::write_small_take(directory_.path());
  std::stop_source stop;
  rig::LiveOptions options = live_options();
  options.loop = true;  // would never end by itself
  options.stop = stop.get_token();
  const auto is_shown = [this] { return std::filesystem::exists(directory_ / "live/picture.png"); };
  const auto stopper = stop_when("picture.png is written", is_shown, stop);
  EXPECT_GT(rig::run_live(options, reports_).stages.at("display").frames, 0u);
}

}  // namespace previz::post::render_test
