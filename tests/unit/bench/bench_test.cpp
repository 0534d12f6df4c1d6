// previzd bench: its table, JSON and page say the same, and what there is no time for is named.
#include "daemon/bench/bench.hpp"

#include <nlohmann/json.hpp>

#include "daemon/bench/frames.hpp"
#include "daemon/bench/page.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::bench::bench_test {

BenchReport example() {
  FrameFigures frame;
  frame.width = 1920;
  frame.height = 1080;
  frame.samples = 1;
  frame.triangles = 5248;
  frame.frames = 12;
  frame.ms = 30;
  frame.interval_ms = 25;
  frame.show_ms = 20;
  frame.screen_ms = 1.5;
  frame.comes_down = false;
  frame.waited_ms = 16;
  frame.passes = {{"extend", 71, 10}, {"shadow", 54, 4}, {"present", 2, 0.01}};
  frame.rays = 20'000'000;
  frame.shadow_rays = 2'000'000;
  frame.work = {.submissions = 1, .waits = 1, .bytes_up = 12'500'000, .bytes_down = 12'400'000};
  BenchReport report;
  report.date = "2026-11-27 18:40";
  report.version = "0.1.0";
  report.device = {.name = "Card <A>",
                   .driver = "Driver 1.2",
                   .is_gpu = true,
                   .memory_bytes = 8'000'000'000,
                   .traces_in_hardware = true};
  report.processor = "Processor";
  report.cores = 8;
  report.up_bytes_s = 12e9;
  report.down_bytes_s = 11e9;
  FrameFigures large = frame;
  large.width = 3840;
  large.height = 2160;
  large.ms = large.interval_ms = 80;
  report.by_size = {frame, large};
  report.set = SetFigures{.set = "desk.toml",
                          .width = 1280,
                          .height = 720,
                          .samples = 2,
                          .ms = 50,
                          .fps = 25,
                          .camera_fps = 25};
  report.left_out = {{"1280x720, 8 samples, 5000 triangles", "it would take about 30 s"}};
  return report;
}

TEST(BenchReport, HasAFrameThatStandsForTheDevice) {
  EXPECT_EQ(example().typical()->width, 1920);
  EXPECT_EQ(BenchReport{}.typical(), nullptr);
}

TEST(BenchReport, SaysInJsonWhatTheTableSays) {
  const auto json = nlohmann::json::parse(bench_json(example()));
  EXPECT_EQ(json["device"]["name"], "Card <A>");
  EXPECT_EQ(json["device"]["traces_in_hardware"], true);
  EXPECT_EQ(json["by_size"][0]["ms"], 30);
  EXPECT_EQ(json["by_size"][0]["frames_per_s"], 40);
  EXPECT_EQ(json["by_size"][0]["rays_per_s"], 2e9);
  EXPECT_EQ(json["by_size"][0]["shadow_rays_per_s"], 5e8);
  EXPECT_EQ(json["by_size"][0]["submissions"], 1);
  EXPECT_EQ(json["by_size"][0]["passes"][1]["pass"], "shadow");
  EXPECT_EQ(json["set"]["frames_per_s"], 20);
  EXPECT_EQ(json["left_out"][0]["why"], "it would take about 30 s");
  const std::string table = bench_table(example());
  for (const char* words :
       {"Card <A>, driver Driver 1.2, 8.0 GB of memory", "rays are traced by its hardware for rays",
        "copies: 12.0 GB/s up, 11.0 GB/s down",
        "2000.0 million rays per second, 500.0 million shadow rays per second",
        "submissions 1, waits 1, allocations 0", "20.0 frames per second; the set asks for 25",
        "not measured: 1280x720, 8 samples, 5000 triangles, it would take about 30 s"})
    EXPECT_THAT(table, HasSubstr(words));
}

TEST(BenchReport, IsAPageThatIsWholeAndEscapesNames) {
  const std::string page = bench_page(example());
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  EXPECT_THAT(page, HasSubstr("<h1>40.0 frames per second at 1920x1080</h1>"));
  EXPECT_THAT(page, HasSubstr("Card &lt;A&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("Card <A>")));
  EXPECT_THAT(page, HasSubstr("traced by its hardware for rays"));
  EXPECT_THAT(page, HasSubstr("all others"));
  EXPECT_THAT(bench_page(BenchReport{}), HasSubstr("Nothing was measured"));
}

// A page always has a figure; what there is no time for is named.
TEST(Bench, MeasuresWhatThereIsTimeForAndNamesTheRest) {
  const test::TemporaryDirectory folder;
  std::ostringstream said;
  const BenchReport report = run_bench({.set_or_session = {},
                                        .json = folder / "bench.json",
                                        .page = folder / "bench.html",
                                        .seconds = 0,
                                        .device = {},
                                        .stop = {}},
                                       said);
  ASSERT_EQ(report.by_size.size(), 1u);
  EXPECT_EQ(report.by_size[0].width, 160);
  EXPECT_EQ(report.left_out.size(), 11u);
  EXPECT_GT(report.start_s, 0);
  EXPECT_FALSE(report.device.name.empty());
  EXPECT_THAT(said.str(), StartsWith("measuring " + report.device.name));
  EXPECT_THAT(said.str(), HasSubstr("\npreparing the first picture: "));
  EXPECT_THAT(said.str(), HasSubstr("\n160x90, 1 sample, 5000 triangles: about "));
  EXPECT_TRUE(std::filesystem::exists(folder / "bench.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "bench.html"));
}

class BenchOn : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(ACpuAndACard, BenchOn, ::testing::Bool());

TEST_P(BenchOn, MeasuresALiveFrameOfWhichItKnowsEveryPart) {
  Frames frames(render::open_device({.name = "", .as_gpu = GetParam(), .times_passes = true}));
  const FrameWish wish{.width = 64, .height = 36};
  EXPECT_GT(frames.expected_s(wish), 0);
  const FrameFigures figures = frames.measure(wish);
  EXPECT_EQ(figures.width, 64);
  EXPECT_GT(figures.triangles, 4000u);
  EXPECT_NEAR(figures.ms, figures.begin_ms + figures.record_ms + figures.show_ms, 1e-9);
  EXPECT_LE(figures.waited_ms, figures.ms);
  EXPECT_GT(figures.interval_ms, 0);
  const char* const shading = GetParam() ? "shade_light" : "shade";
  for (const char* pass : {"extend", shading, "shadow", "photon_emit", "history", "denoise"})
    EXPECT_GT(figures.ms_of(pass), 0) << pass;
  EXPECT_GT(figures.rays, 64u * 36u);
  EXPECT_EQ(figures.work.allocations, 0u);
  // A display has the picture from a card's memory.
  EXPECT_EQ(figures.comes_down, !GetParam());
  EXPECT_EQ(figures.work.bytes_down >= 6u * 64 * 36, !GetParam());
  // It takes up the camera's bytes; a processor makes the plate of them before.
  EXPECT_EQ(figures.work.bytes_up >= 6u * 64 * 36, !GetParam());
  EXPECT_GT(figures.screen_ms, 0);
}

}  // namespace previz::bench::bench_test
