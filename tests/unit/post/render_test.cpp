// `previz render` and `previzd run` from end to end on a small take, on whatever Vulkan device
// there is (Mesa's CPU driver where there is no GPU).
#include "daemon/tools/post/render.hpp"

#include <nlohmann/json.hpp>

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/rig/live.hpp"
#include "drivers/plate.hpp"
#include "tests/support/content_of.hpp"
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
  RenderSession() { test::write_small_take(directory_.path()); }
  // Another take in the place of the small one.
  template <class... How>
  void write_take(const How&... how) {
    std::filesystem::remove_all(directory_ / "session");
    test::write_small_take(directory_.path(), how...);
  }
  RenderReport render(RenderOptions options) {
    options.session = directory_ / "session";
    if (!options.directory) options.directory = directory_ / "out";
    out_.str("");
    return render_session(options, out_);
  }
  // Options for a range of frames.
  static RenderOptions of_frames(std::uint64_t first, std::uint64_t last) {
    RenderOptions options;
    options.frames = FrameRange{first, last};
    return options;
  }
  // The layers of one frame.
  render::Layers layers_of(RenderOptions options) {
    render::Layers layers;
    options.on_frame = [&](const pipeline::Shot& shot) { layers = *shot.layers; };
    EXPECT_EQ(render(options).frames.at(0).status, FrameStatus::rendered);
    return layers;
  }
  rig::LiveOptions live_options() const {
    rig::LiveOptions options;
    options.set_file = directory_ / "set.toml";
    options.directory = directory_ / "live";
    return options;
  }
  // Runs live, over and over the take, until the condition holds, and, with a failure, where it
  // never does.
  pipeline::MetricsSnapshot run_until(rig::LiveOptions options, const std::string& what,
                                      const std::function<bool()>& condition) {
    std::stop_source stop;
    options.stop = stop.get_token();
    options.loop = true;  // would never end by itself
    const std::jthread stopper([&](const std::stop_token& left) {
      EXPECT_TRUE(test::wait_until(what, [&] { return left.stop_requested() || condition(); }));
      stop.request_stop();
    });
    return rig::run_live(options, reports_);
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
  const RenderReport report = render({});
  ASSERT_EQ(report.frames.size(), std::size_t{small_take_frames});
  EXPECT_FALSE(report.interrupted);
  EXPECT_GT(std::filesystem::file_size(report.video), 0u);
  EXPECT_THAT(out_.str(), HasSubstr(std::to_string(small_take_frames) + " pictures"));
  EXPECT_THAT(out_.str(), HasSubstr(": uses the set recorded with it; --set FILE uses another\n"));
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
  RenderOptions options = of_frames(1, 1);
  options.denoise = false;
  const render::Layers seen = layers_of(options);
  const std::size_t middle = 18 * 48 + 24;
  EXPECT_EQ(seen.mask[middle], 1.0f);
  EXPECT_NEAR(seen.depth[middle], 0.9f, 1e-3f);
  EXPECT_GT(seen.composite[middle].g, 0.0f);
  EXPECT_EQ(seen.mask[0], 0.0f);
  EXPECT_EQ(seen.composite[middle], seen.mixed[middle]);
}

TEST_F(RenderSession, AnAdaptivePictureSaysSoAndIsNoOther) {
  RenderOptions options = of_frames(1, 1);
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
  RenderOptions options = of_frames(1, 1);
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
  write_take(true, "[lighting]\nmode = \"sources\"\nfrom = \"recording\"\n", light);
  render::Layers seen;
  RenderOptions options = of_frames(small_take_unlit, small_take_unlit);
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
  write_take(true,
             "[lighting]\nfrom = \"set\"\n[[light]]\ntype = \"directional\"\n"
             "direction = [0, 0, -1]\nemission = [3, 2, 1]\ngain_real = 1\n");
  const render::Layers seen = layers_of(of_frames(small_take_unlit, small_take_unlit));
  const glm::vec3 card = seen.mixed[18 * 48 + 24];
  EXPECT_NEAR(card.r / card.b, 3, 1e-4);
}

constexpr const char* dazzling =
    "[lighting]\nfrom = \"set\"\n[[light]]\ntype = \"directional\"\n"
    "direction = [0.6, 0, -0.8]\nemission = [300, 200, 100]\ngain_real = 1\n";

// The floor under a lamp of 300, 200 and 100 W/m^2 reflects hundreds of times what the plate of a
// camera whose white is 1 can show. The card's shadow would take more light than there is.
TEST_F(RenderSession, ALightThatDoesNotFitThePictureIsSaid) {
  write_take(true, dazzling);
  render::Layers layers;
  RenderOptions options = of_frames(1, 2);
  options.on_frame = [&](const pipeline::Shot& shot) { layers = *shot.layers; };
  render(options);
  EXPECT_NE(out_.str().find("light: the model under this light is "), std::string::npos)
      << out_.str();
  EXPECT_NE(out_.str().find("previz calibrate balance"), std::string::npos) << out_.str();
  EXPECT_NE(out_.str().find("light: shadows would have taken more light"), std::string::npos)
      << out_.str();
  for (const glm::vec3& value : layers.composite)
    for (int c = 0; c < 3; ++c) ASSERT_GE(value[c], 0);
}

// A frame that was recorded with the environment turned by hand has the light that the set's key
// gives, bit for bit.
TEST_F(RenderSession, ATurnedEnvironmentIsAsItWasRecorded) {
  std::string panorama = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n";
  for (int pixel = 0; pixel < 8; ++pixel) panorama += {char(10 + 30 * pixel), 80, 90, char(129)};
  const auto light_with = [&](const std::string& key, const std::string& recorded) {
    write_take(true, "[lighting]\nenvironment = \"room.hdr\"\n" + key);
    for (const auto& folder : {directory_.path(), directory_ / "session"})
      std::ofstream(folder / "room.hdr", std::ios::binary) << panorama;
    std::string lines = test::content_of(directory_ / "session/track.jsonl");
    const std::string before = "\"tracked\"";
    for (std::size_t at = 0; (at = lines.find(before, at)) != std::string::npos;
         at += recorded.size() + before.size())
      lines.insert(at, recorded);
    std::ofstream(directory_ / "session/track.jsonl") << lines;
    std::filesystem::remove_all(directory_ / "out");
    RenderOptions options = of_frames(1, 1);
    options.set_file = directory_ / "set.toml";
    std::vector<glm::vec3> radiance;
    options.on_frame = [&](const pipeline::Shot& shot) {
      radiance = shot.light->lighting.environment.radiance;
    };
    render(options);
    return radiance;
  };
  const auto by_hand =
      light_with("environment_rotation_deg = 20\n", "\"environment_turn_rad\":0.5235987755982988,");
  EXPECT_EQ(by_hand, light_with("environment_rotation_deg = 50\n", ""));
  EXPECT_NE(by_hand, light_with("environment_rotation_deg = 20\n", ""));
}

TEST_F(RenderSession, WithNothingVirtualEveryPictureIsThePlateBitForBit) {
  write_take(false);
  render({});
  for (int i = 0; i < small_take_frames; ++i)
    EXPECT_TRUE(is_plate(directory_ / ("out/000" + std::to_string(i) + ".png"), i)) << i;
}

TEST_F(RenderSession, ASecondRunSkipsWhatIsFinishedAndOtherSamplesAreRefused) {
  RenderOptions options = of_frames(0, 2);
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

// The floor counts as a printed tag, which was hidden while the take was recorded.
TEST_F(RenderSession, TagsAreHiddenAsTheyWereRecordedUnlessTheOptionSaysOtherwise) {
  const auto edit = [&](const std::filesystem::path& file, const std::string& from,
                        const std::string& to) {
    std::string text = test::content_of(file);
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    std::ofstream(file) << text;
  };
  write_take(false);
  edit(directory_ / "floor.gltf", "\"square\"", "\"tag 1\"");
  edit(directory_ / "session/track.jsonl", "\"tracked\"", "\"hides_tags\":true,\"tracked\"");
  RenderOptions options = of_frames(1, 1);
  options.set_file = directory_ / "set.toml";
  const auto covered = [&] { return layers_of(options).mask[18 * 48 + 24]; };
  EXPECT_EQ(covered(), 1);
  EXPECT_THAT(out_.str(), HasSubstr("tags: printed tags are hidden\n"));
  EXPECT_THAT(out_.str(), HasSubstr("their outlines may be seen: 1;"));
  options.hides_tags = false;
  EXPECT_THAT(test::error_of([&] { render(options); }), HasSubstr("hides_tags"));
  options.directory = directory_ / "shown";
  EXPECT_EQ(covered(), 0);
  EXPECT_THAT(out_.str(), Not(HasSubstr("tags:")));
}

// 24 x 18 of the 48 x 36 pixels: to look at a take quickly. It is another picture, not the same.
TEST_F(RenderSession, ASmallerPictureIsAnotherOne) {
  RenderOptions options = of_frames(small_take_lost, small_take_lost + 1);
  options.scale = 0.5;
  const RenderReport report = render(options);
  ASSERT_EQ(report.frames.size(), 2u);
  for (const char* name : {"out/0003", "out/0004"}) {
    EXPECT_EQ(output::read_png(directory_ / (std::string(name) + ".png")).width, 24);
    const render::Layers layers = output::read_exr(directory_ / (std::string(name) + ".exr"));
    EXPECT_EQ(layers.width, 24);
    EXPECT_EQ(layers.height, 18);
  }
  options.scale = 1;
  EXPECT_THAT(test::error_of([&] { render(options); }),
              HasSubstr("scale is 0.5 there and 1.0 now"));
}

TEST_F(RenderSession, AStopLeavesWholeFramesAndTheNextRunEndsInTheSamePictures) {
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
  write_take(true, "[lighting]\nunseen = \"observer\"\nsmoothing_s = 5\n");
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
  std::filesystem::create_directory(directory_ / "elsewhere");
  std::filesystem::rename(directory_ / "set.toml", directory_ / "elsewhere/tweaked.toml");
  RenderOptions options;
  options.set_file = directory_ / "elsewhere/tweaked.toml";
  options.frames = FrameRange{1, 1};
  EXPECT_EQ(render(options).frames.size(), 1u);
  EXPECT_THAT(out_.str(), Not(HasSubstr("the set recorded with it")));
}

// Offline and live: a white sheet in 100000 lux is 31831 times white.
TEST_F(RenderSession, ALampThatIsTooBrightIsSaidOnce) {
  std::ofstream(directory_ / "sun.gltf") << R"({"asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_lights_punctual"], "extensions": {"KHR_lights_punctual":
      {"lights": [{"type": "directional", "name": "sun", "intensity": 100000}]}},
    "nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}],
    "scene": 0, "scenes": [{"nodes": [0]}]})";
  std::ofstream(directory_ / "set.toml", std::ios::app)
      << "[[object]]\nname = \"lamps\"\nfile = \"sun.gltf\"\npresence = \"virtual\"\n";
  RenderOptions options = of_frames(0, 1);
  options.set_file = directory_ / "set.toml";
  const auto times_said = [&] {
    const std::string said = out_.str(), words = "is 31831 times white: ";
    const auto at = said.find(words);
    return at == std::string::npos ? 0 : said.find(words, at + 1) == std::string::npos ? 1 : 2;
  };
  render(options);
  EXPECT_EQ(times_said(), 1) << out_.str();
  out_.str("");
  rig::run_live(live_options(), reports_);
  EXPECT_EQ(times_said(), 1) << out_.str();
}

// The set of a take from elsewhere does not choose a folder to write into; the crew does.
TEST_F(RenderSession, ATakesOwnSetWritesNowhereElse) {
  const std::filesystem::path elsewhere = directory_ / "elsewhere";
  write_take(true, "[output]\ndirectory = \"" + elsewhere.string() + "\"\n");
  RenderOptions options;
  options.session = directory_ / "session";
  options.frames = FrameRange{1, 1};
  EXPECT_THROW(render_session(options, out_), Error);
  EXPECT_FALSE(std::filesystem::exists(elsewhere));
  options.any_paths = true;
  EXPECT_EQ(render_session(options, out_).directory, elsewhere);
}

TEST_F(RenderSession, ARangeBehindTheEndIsRefused) {
  EXPECT_THROW(render(of_frames(80, 90)), Error);
}

// Live: nothing vanishes. Every frame of the camera was shown or is counted as dropped, with cause.
TEST_F(RenderSession, LiveAccountsForEveryFrame) {
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
TEST_F(RenderSession, LiveSaysThatTheLightDoesNotFitThePicture) {
  write_take(true, dazzling);
  run_until(live_options(), "the light is compared with the picture",
            [&] { return !reports_.troubles().empty(); });
  EXPECT_NE(out_.str().find("light of the set: the model under this light is "), std::string::npos)
      << out_.str();
}

TEST_F(RenderSession, LiveTakesTheSamplesItIsAskedFor) {
  rig::LiveOptions options = live_options();
  options.samples = 3;  // the set says 2
  std::atomic<bool> rendered = false;
  std::set<int> samples;  // of the pictures that were rendered whole
  options.on_shown = [&](const pipeline::Shot& shot, const live::Look&) {
    if (!shot.whole || !shot.untouched.empty()) return;
    samples.insert(shot.samples);
    rendered = true;
  };
  run_until(options, "a picture is rendered", [&] { return rendered.load(); });
  EXPECT_EQ(samples, std::set<int>{3});
}

// quality.scale is of the preview only.
TEST_F(RenderSession, LiveKeepsThePlateAtAnyScaleAndOfflineIsFullSize) {
  write_take(false, "scale = 0.5\n");
  rig::run_live(live_options(), reports_);
  const Plate last = to_plate(small_take_frame(small_take_frames - 1));
  const Plate shown = output::read_png(directory_ / "live/picture.png");
  EXPECT_EQ(shown.width, 48);
  EXPECT_EQ(shown.samples, last.samples);  // nothing is virtual: the plate, bit for bit

  render(of_frames(1, 1));
  EXPECT_TRUE(is_plate(directory_ / "out/0001.png", 1));
}

TEST_F(RenderSession, LiveFillsTheLightFromTheFilmCamera) {
  write_take(true, "[lighting]\nunseen = \"observer\"\n");
  rig::LiveOptions options = live_options();
  std::atomic<bool> lit = false;
  options.on_shown = [&](const pipeline::Shot& shot, const live::Look&) {
    if (shot.light) lit = true;
  };
  const pipeline::MetricsSnapshot metrics =
      run_until(options, "a picture has light", [&] { return lit.load(); });
  EXPECT_GT(metrics.stages.at("lighting").frames, 0u);
  EXPECT_THAT(out_.str(), HasSubstr("filled by the rule \"observer\""));
}

}  // namespace previz::post::render_test
