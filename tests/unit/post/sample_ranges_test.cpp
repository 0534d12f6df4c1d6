// `previz render --sample-range` and `previz merge`: a take whose frames' samples are rendered in
// ranges has the files of one that is rendered as a whole.
#include "daemon/tools/post/sample_ranges.hpp"

#include <nlohmann/json.hpp>

#include "daemon/core/output/sums_exr.hpp"
#include "daemon/tools/post/render.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"

namespace previz::post::sample_ranges_test {

using session::content_of, session::write_content;
using test::small_take_lost;

TEST(SampleRangeText, IsOneOfHowMany) {
  EXPECT_EQ(parse_sample_range("2/4"), (render::SampleRange{2, 4}));
  EXPECT_EQ(parse_sample_range("1/1"), (render::SampleRange{1, 1}));
  for (const char* text : {"", "2", "/", "2/", "/4", "0/4", "5/4", "-1/4", "2/4/8", "a/b", "2 / 4"})
    EXPECT_THAT(test::error_of([&] { parse_sample_range(text); }), HasSubstr("2/4 for the second"))
        << text;
}

set::Quality quality_of(int samples) {
  set::Quality quality;
  quality.samples = samples;
  quality.neighbours = 0;
  return quality;
}

TEST(SampleRangeCheck, SaysWhyAFrameCannotBeDivided) {
  const auto why = [](render::SampleRange range, const set::Quality& quality) {
    return test::error_of([&] { check_sample_range(range, quality); });
  };
  set::Quality quality = quality_of(256);
  quality.adaptive = false;
  EXPECT_EQ(why({1, 1}, quality), "");
  EXPECT_EQ(why({4, 4}, quality), "");
  const std::string most = " can be divided into 1, 2 or 4 ranges of 64 or more";
  EXPECT_EQ(why({1, 8}, quality), "--sample-range 1/8: 256 samples" + most);
  EXPECT_EQ(why({1, 3}, quality), "--sample-range 1/3: 256 samples" + most);
  quality.samples = 128;
  EXPECT_THAT(why({1, 4}, quality), HasSubstr("128 samples can be divided into 1 or 2 ranges of"));
  quality.samples = 127;
  EXPECT_THAT(why({1, 2}, quality), HasSubstr("127 samples can be divided into 1 range"));
  quality.samples = 256;
  quality.neighbours = 2;
  EXPECT_EQ(why({1, 2}, quality).empty(), !quality.denoise);
  quality.denoise = true;
  EXPECT_THAT(why({1, 2}, quality), HasSubstr("--neighbours 0"));
  quality.denoise = false;
  EXPECT_EQ(why({1, 2}, quality), "");
  quality.adaptive = true;
  EXPECT_THAT(why({1, 2}, quality), HasSubstr("--even"));
  quality.error = 0.1;
  EXPECT_THAT(why({1, 2}, quality), HasSubstr("quality.error"));
  quality.error = 0;
  quality.seconds = 2;
  EXPECT_THAT(why({1, 2}, quality), HasSubstr("quality.seconds"));
}

output::RangeSums extreme_sums(bool has_photons) {
  output::RangeSums sums{70'000, {2, 4}, {3, 2, 64, {}}};
  sums.sums.sums.pixels.resize(6);
  if (has_photons) sums.sums.sums.caustics.resize(6);
  const float values[] = {0, -0.0f, 1e-45f, 1e30f, -1e-38f, 1.0f / 3};
  std::size_t next = 0;
  for (gpu::GpuPixel& pixel : sums.sums.sums.pixels) {
    float floats[sizeof(pixel) / sizeof(float)];
    for (float& value : floats) value = values[next % 6] * static_cast<float>(next + 1), ++next;
    std::memcpy(&pixel, floats, sizeof(pixel));
  }
  for (glm::vec4& caustic : sums.sums.sums.caustics) caustic = glm::vec4(1e-44f, 2, -3, 4);
  sums.sums.counters.rays = 1ull << 60;
  sums.sums.counters.unmeasured = 7;
  return sums;
}

TEST(SumsExr, ComesBackWithTheSameBits) {
  const test::TemporaryDirectory directory;
  for (const bool has_photons : {false, true}) {
    const output::RangeSums sums = extreme_sums(has_photons);
    output::write_sums_exr(directory / "0.sums.exr", sums);
    const output::RangeSums read = output::read_sums_exr(directory / "0.sums.exr");
    EXPECT_EQ(read.frame, 70'000u);
    EXPECT_EQ(read.range, sums.range);
    EXPECT_EQ(read.sums.width, 3);
    EXPECT_EQ(read.sums.height, 2);
    EXPECT_EQ(read.sums.samples, 64);
    EXPECT_EQ(read.sums.counters.rays, 1ull << 60);
    EXPECT_EQ(read.sums.counters.unmeasured, 7u);
    const auto &a = sums.sums.sums, &b = read.sums.sums;
    ASSERT_EQ(a.pixels.size(), b.pixels.size());
    EXPECT_TRUE(
        std::ranges::equal(std::as_bytes(std::span(a.pixels)), std::as_bytes(std::span(b.pixels))));
    EXPECT_EQ(a.caustics, b.caustics);
  }
}

// A file of a few bytes that claims a large picture would take all memory; one that is black has
// less than a thousandth of its pixels' bytes.
TEST(SumsExr, IsRefusedWhereItCannotHoldItsPixels) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path file = directory / "0.sums.exr";
  output::RangeSums black{0, {1, 2}, {400, 300, 64, {}}};
  black.sums.sums.pixels.resize(400 * 300);
  output::write_sums_exr(file, black);
  EXPECT_EQ(output::read_sums_exr(file).sums.width, 400);
  output::write_sums_exr(file, extreme_sums(false));
  std::string bytes = content_of(file);
  const std::string name("dataWindow\0box2i\0", 17);
  const std::int32_t window[] = {0, 0, 49999, 999};
  bytes.replace(bytes.find(name) + name.size() + 4, sizeof(window),
                std::string_view(reinterpret_cast<const char*>(window), sizeof(window)));
  write_content(file, bytes);
  EXPECT_THAT(test::error_of([&] { output::read_sums_exr(file); }),
              HasSubstr("is too small for its 50000000 pixels"));
}

TEST(SumsExr, IsRefusedWhereItIsAnotherFile) {
  const test::TemporaryDirectory directory;
  write_content(directory / "0.sums.exr", "no picture");
  EXPECT_THAT(test::error_of([&] { output::read_sums_exr(directory / "0.sums.exr"); }),
              HasSubstr("0.sums.exr"));
}

// Frames 2 to 4 of the small take, with enough samples for two ranges; frame 3 has no pose.
class MergedTake : public testing::Test {
 protected:
  MergedTake() { test::write_small_take(directory_.path()); }

  RenderOptions options_for(const std::string& folder) const {
    RenderOptions options;
    options.session = directory_ / "session";
    options.directory = directory_ / folder;
    options.frames = FrameRange{2, 4};
    options.samples = 128;
    options.adaptive = false;
    options.neighbours = 0;
    options.scale = 0.5;
    return options;
  }
  RenderReport run(const RenderOptions& options) {
    out_.str("");
    return render_session(options, out_);
  }
  RenderReport render_range(render::SampleRange range, const std::string& folder) {
    RenderOptions options = options_for(folder);
    options.sample_range = range;
    return run(options);
  }
  void render_ranges() {
    render_range({1, 2}, "first");
    render_range({2, 2}, "second");
  }
  RenderReport merge(const std::string& folder,
                     const std::vector<std::string>& from = {"second", "first"}) {
    RenderOptions options = options_for(folder);
    for (const std::string& name : from) options.sums_from.push_back(directory_ / name);
    return run(options);
  }
  std::string content(const std::string& file) const { return content_of(directory_ / file); }
  // Appends a byte.
  void damage(const std::string& file) const {
    write_content(directory_ / file, content(file) + "x");
  }

  test::TemporaryDirectory directory_;
  std::ostringstream out_;
};

TEST_F(MergedTake, HasTheFilesOfOneRun) {
  const RenderReport whole = run(options_for("whole"));
  const RenderReport first = render_range({1, 2}, "first");
  EXPECT_THAT(out_.str(), HasSubstr("128 samples, denoised, range 1/2 of them"));
  ASSERT_EQ(first.frames.size(), 3u);
  EXPECT_TRUE(first.video.empty());
  EXPECT_EQ(first.frames[0].samples, 64);
  EXPECT_EQ(first.frames[0].files.size(), 1u);
  EXPECT_TRUE(first.frames[0].files.contains("0002.sums.exr"));
  EXPECT_EQ(first.frames[1].status, FrameStatus::untouched);
  EXPECT_TRUE(first.frames[1].files.empty());
  const RenderReport second = render_range({2, 2}, "second");

  const RenderReport merged = merge("merged");
  EXPECT_THAT(merged.failures, IsEmpty());
  ASSERT_EQ(merged.frames.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(merged.frames[i].files, whole.frames[i].files) << i;
    EXPECT_EQ(merged.frames[i].samples, whole.frames[i].samples);
    EXPECT_EQ(merged.frames[i].counters.rays, whole.frames[i].counters.rays);
    EXPECT_EQ(merged.frames[i].counters.rays,
              first.frames[i].counters.rays + second.frames[i].counters.rays);
  }
  EXPECT_EQ(merged.frames[1].status, FrameStatus::untouched);
  EXPECT_EQ(content("merged/render.json"), content("whole/render.json"));
  EXPECT_EQ(content("merged/0002.exr"), content("whole/0002.exr"));
  EXPECT_FALSE(merged.video.empty());
}

TEST_F(MergedTake, LeavesOutAFrameWhoseSumsAreDamagedOrMissing) {
  render_ranges();
  damage("second/0004.sums.exr");
  RenderReport merged = merge("merged");
  ASSERT_EQ(merged.frames.size(), 2u);
  EXPECT_EQ(merged.frames[0].frame, 2u);
  EXPECT_TRUE(merged.video.empty());
  ASSERT_EQ(merged.failures.size(), 1u);
  EXPECT_THAT(merged.failures[0],
              AllOf(HasSubstr("frame 4: sample range 2/2: "), HasSubstr("second"),
                    HasSubstr("its .sums.exr has another size than when it was written"),
                    HasSubstr("--sample-range 2/2 --frames 4")));
  std::filesystem::remove(directory_ / "first/0004.sums.exr");
  EXPECT_THAT(merge("merged").failures.at(0),
              HasSubstr("frame 4: sample range 1/2: " + (directory_ / "first").string() +
                        ": its .sums.exr is missing"));
  // The ranges are rendered again where they are not whole, and the merge goes on.
  EXPECT_EQ(render_range({2, 2}, "second").found_finished, 2u);
  EXPECT_THAT(out_.str(), HasSubstr("rendered again: frame 4: its .sums.exr has another size"));
  EXPECT_EQ(render_range({1, 2}, "first").found_finished, 2u);
  merged = merge("merged");
  EXPECT_EQ(merged.found_finished, 2u);
  EXPECT_EQ(merged.frames.size(), 3u);
  EXPECT_THAT(merged.failures, IsEmpty());
}

TEST_F(MergedTake, TakesNoFileOfAnotherFrame) {
  render_ranges();
  std::filesystem::copy_file(directory_ / "first/0002.sums.exr", directory_ / "first/0004.sums.exr",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(merge("merged").failures.at(0), HasSubstr("frame 4: sample range 1/2"));
}

TEST_F(MergedTake, RefusesFoldersThatDoNotGoTogether) {
  render_ranges();
  const auto why = [&](const std::vector<std::string>& from) {
    return test::error_of([&] { merge("merged", from); });
  };
  EXPECT_THAT(why({"second"}), HasSubstr("no folder has the samples of range 1/2"));
  EXPECT_THAT(why({"first", "session"}), HasSubstr("has no render.json"));
  RenderOptions options = options_for("whole");
  options.frames = FrameRange{3, 3};
  run(options);
  EXPECT_THAT(why({"first", "whole"}), HasSubstr("was not written with --sample-range"));
  options = options_for("merged");
  options.seed = 9;
  options.sums_from = {directory_ / "first", directory_ / "second"};
  EXPECT_THAT(test::error_of([&] { run(options); }),
              AllOf(HasSubstr("first/render.json"), HasSubstr("seed is ")));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "merged"));
  // Sums and pictures do not mix in a folder.
  EXPECT_THAT(test::error_of([&] { run(options_for("first")); }), HasSubstr("sample_range"));
  EXPECT_THAT(test::error_of([&] {
                render_range({1, 2}, "second");
              }),
              HasSubstr("sample_range is \"2/2\" there and \"1/2\" now"));
}

}  // namespace previz::post::sample_ranges_test
