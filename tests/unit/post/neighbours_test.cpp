// `previz render` of pictures that are averaged with their neighbours in time, on a small take:
// whatever part of it is rendered, and by whom, the files are the same.
#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/tools/post/render.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"

namespace previz::post::neighbours_test {

using test::small_take_frames;
using test::small_take_lost;

using Sums = std::map<std::string, std::string>;  // SHA-256 by the file's name

class RenderNeighbours : public testing::Test {
 protected:
  RenderNeighbours() { test::write_small_take(directory_.path()); }
  RenderReport render(const std::string& folder, RenderOptions options) {
    options.session = directory_ / "session";
    options.directory = directory_ / folder;
    options.video = false;
    std::ostringstream out;
    RenderReport report = render_session(options, out);
    if (out_.empty()) out_ = out.str();
    return report;
  }
  RenderReport render(const std::string& folder, const std::optional<FrameRange>& frames = {},
                      const std::optional<int>& neighbours = {}) {
    RenderOptions options;
    options.frames = frames;
    options.neighbours = neighbours;
    return render(folder, options);
  }
  static Sums sums_of(const RenderReport& report) {
    Sums sums;
    for (const FinishedFrame& frame : report.frames)
      for (const auto& [file, mark] : frame.files) sums[file] = mark.sha256;
    return sums;
  }
  std::string content_of(const std::string& file) const {
    return session::content_of(directory_ / file);
  }

  test::TemporaryDirectory directory_;
  std::string out_;  // of the first run
};

// One part ends beside the frame without a pose, one has it within its neighbours and the take's
// end, and one is it.
TEST_F(RenderNeighbours, EveryPartOfATakeHasTheFilesOfTheWhole) {
  const RenderReport whole = render("whole");
  EXPECT_THAT(out_, HasSubstr("denoised, over 2 frames on either side"));
  ASSERT_EQ(whole.frames.size(), std::size_t{small_take_frames});
  const Sums expected = sums_of(whole);
  EXPECT_EQ(expected.size(), 2u * small_take_frames);
  for (const FrameRange range :
       {FrameRange{1, 2}, FrameRange{5, 6}, FrameRange{small_take_lost, small_take_lost}}) {
    const std::string folder = "from" + std::to_string(range.first);
    const Sums part = sums_of(render(folder, range));
    EXPECT_EQ(part.size(), 2 * (range.last - range.first + 1));
    for (const auto& [file, sum] : part) EXPECT_EQ(sum, expected.at(file)) << file;
  }
}

// Frames that are there are not written again, but they are neighbours of those that are not.
TEST_F(RenderNeighbours, ALaterRunFillsTheGapsWithTheSamePictures) {
  const Sums expected = sums_of(render("whole"));
  render("out", FrameRange{2, 2});
  render("out", FrameRange{5, 5});
  const RenderReport report = render("out");
  EXPECT_EQ(report.found_finished, 2u);
  EXPECT_EQ(sums_of(report), expected);
}

TEST_F(RenderNeighbours, TwoAtWorkInOneFolderMakeTheSamePictures) {
  const Sums expected = sums_of(render("whole"));
  constexpr std::uint64_t last = small_take_frames - 1;
  for (const auto& [one, two] : {std::pair(FrameRange{0, 4}, FrameRange{3, last}),
                                 std::pair(FrameRange{0, last}, FrameRange{0, last})}) {
    const std::string folder = "to" + std::to_string(one.last);
    {
      const std::jthread other([&, range = one] { render(folder, range); });
      render(folder, two);
    }
    const RenderReport report = render(folder);
    EXPECT_EQ(report.found_finished, std::size_t{small_take_frames});
    EXPECT_EQ(sums_of(report), expected);
  }
}

// A disk that fails after the take was opened leaves a frame that cannot be read. Another process
// that shares the take, here one that runs while the first writes its last frame, neither waits for
// the frame nor says that it is being rendered.
TEST_F(RenderNeighbours, AFrameThatCannotBeReadIsNobodys) {
  constexpr std::uint64_t unreadable = 5;
  test::make_unreadable(directory_ / "session", unreadable);
  for (const int neighbours : {0, 2}) {
    const std::string folder = "out" + std::to_string(neighbours);
    std::optional<RenderReport> of_another;
    RenderOptions options;
    options.neighbours = neighbours;
    options.on_frame = [&](const pipeline::Shot& shot) {
      if (shot.index != small_take_frames - 1) return;
      out_.clear();
      of_another = render(folder, FrameRange{unreadable, unreadable}, neighbours);
    };
    const RenderReport report = render(folder, options);
    EXPECT_EQ(report.frames.size(), std::size_t{small_take_frames - 1});
    ASSERT_TRUE(of_another);
    EXPECT_TRUE(of_another->frames.empty());
    EXPECT_EQ(of_another->at_others, 0u) << out_;
    EXPECT_THAT(out_, HasSubstr("the frame is skipped"));
    EXPECT_THAT(out_, Not(HasSubstr("left unfinished")));
  }
}

// With none on either side a picture is what the render stage makes of its frame alone, and a
// folder that knows nothing of neighbours can be gone on with.
TEST_F(RenderNeighbours, WithoutNeighboursAFrameStandsAlone) {
  render("alone", FrameRange{5, 5}, 0);
  EXPECT_THAT(content_of("alone/render.json"), Not(HasSubstr("\"neighbours\"")));
  const pipeline::Take take = pipeline::open_take(directory_ / "session", {});
  const scene::Scene scene = scene::load_scene(take.set);
  pipeline::RenderStageOptions with_layers;
  with_layers.layers = true;
  pipeline::RenderStage stage(render::open_device({}), take.set, take.observer, scene, with_layers);
  for (pipeline::Shot& shot : pipeline::TakeShots(take, {.first = 5, .last = 5})) {
    stage(shot);
    EXPECT_EQ(output::read_png(directory_ / "alone/0005.png").samples, shot.picture->samples);
    EXPECT_EQ(output::read_exr(directory_ / "alone/0005.exr").composite, shot.layers->composite);
  }
  EXPECT_THROW(render("alone", FrameRange{6, 6}, 2), Error);
  EXPECT_EQ(render("alone", FrameRange{5, 6}, 0).found_finished, 1u);
  render("among", FrameRange{5, 5}, 2);
  EXPECT_THAT(content_of("among/render.json"), HasSubstr("\"neighbours\": 2"));
  EXPECT_THROW(render("among", FrameRange{6, 6}, 0), Error);
}

// Otherwise a long render would end in the middle, for want of memory.
TEST_F(RenderNeighbours, WhatDoesNotFitIntoMemoryIsRefusedBeforeAnyFrameIsRendered) {
  RenderOptions options;
  options.memory = 300'000'000;
  EXPECT_THAT(test::error_of([&] { render("out", options); }),
              HasSubstr("pictures of 48x36 take at least 0.402 GB"));
  EXPECT_EQ(content_of("out/frames.jsonl"), "");
  options.memory.reset();
  options.free_memory = 300'000'000;
  EXPECT_THAT(test::error_of([&] { render("out", options); }), HasSubstr("0.27 GB are free"));
}

// Between the two: what is in bands of 48x36 pixels takes 2.7 MB, half of which has to be in
// memory.
TEST_F(RenderNeighbours, InScratchFilesArePicturesOfMemory) {
  render("memory");
  RenderOptions options;
  options.memory = 402'600'000;
  options.scratch = "/var/tmp";  // on a disk, unlike some TMPDIR
  EXPECT_EQ(render("scratch", options).frames.size(), std::size_t{small_take_frames});
  for (int frame = 0; frame < small_take_frames; ++frame)
    for (const char* ending : {".exr", ".png"}) {
      const std::string name = "/000" + std::to_string(frame) + ending;
      EXPECT_EQ(content_of("memory" + name), content_of("scratch" + name)) << name;
    }
  EXPECT_THAT(content_of("scratch/frames.jsonl"), HasSubstr("\"peak_memory_bytes\":"));
  options.scratch = "/dev/shm";
  EXPECT_THAT(test::error_of([&] { render("out", options); }),
              HasSubstr("/dev/shm: cannot hold the scratch files of a render: it lies in the"));
}

TEST_F(RenderNeighbours, TheSetMayAskForUpToFour) {
  std::filesystem::remove_all(directory_ / "session");
  test::write_small_take(directory_.path(), true, "neighbours = 5\n");
  EXPECT_THAT(test::error_of([&] { render("out"); }), HasSubstr("0 to 4"));
}

}  // namespace previz::post::neighbours_test
