// Which frames each of several processes renders that share a take: here two objects that have the
// same folder open.
#include "daemon/tools/post/frames_to_render.hpp"

#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::post::frames_to_render_test {

std::set<std::uint64_t> frames_from(std::uint64_t first, std::uint64_t end) {
  std::set<std::uint64_t> frames;
  for (std::uint64_t frame = first; frame < end; ++frame) frames.insert(frames.end(), frame);
  return frames;
}

class FramesToRenderTest : public testing::Test {
 protected:
  // Asks for the frames of a range, and returns those that are written.
  static std::set<std::uint64_t> written(FramesToRender& frames, std::uint64_t first,
                                         std::uint64_t end) {
    std::set<std::uint64_t> own;
    for (std::uint64_t frame = first; frame < end; ++frame)
      if (frames.is_rendered(frame) && frames.is_written(frame)) own.insert(frame);
    return own;
  }

  void release(const std::set<std::uint64_t>& frames) {
    for (const std::uint64_t frame : frames) {
      one_.release(frame);
      two_.release(frame);
    }
  }

  test::TemporaryDirectory directory_;
  set::Output output_{directory_ / "out", true, true, false};
  RenderDirectory one_{output_, "{}", false}, two_{output_, "{}", false};
};

// The first is half through when the second starts. As long as a frame is a neighbour of the first
// half anyway, the second half is not taken.
TEST_F(FramesToRenderTest, TwoShareATakeHoweverShortItIs) {
  for (const std::uint64_t count : {2, 3, 8, 15, 16, 17, 24, 31, 32})
    for (const int neighbours : {0, 1, 2, 4}) {
      SCOPED_TRACE(std::to_string(count) + " frames, neighbours " + std::to_string(neighbours));
      const std::set<std::uint64_t> all = frames_from(0, count);
      FramesToRender first(one_, all, neighbours, count), second(two_, all, neighbours, count);
      const std::uint64_t half = (count + 1) / 2;
      EXPECT_EQ(written(first, 0, half), frames_from(0, half));
      EXPECT_EQ(written(second, 0, count), frames_from(half, count));
      EXPECT_EQ(written(first, half, count), std::set<std::uint64_t>());
      EXPECT_EQ(first.left(), frames_from(half, count));
      release(all);
    }
}

// The neighbours beyond the ends of a run are rendered twice, so runs are not too short either.
TEST_F(FramesToRenderTest, OfALongTakeRunsOfSixteenAreTaken) {
  const std::set<std::uint64_t> all = frames_from(0, 100);
  FramesToRender first(one_, all, 2, 100), second(two_, all, 2, 100);
  EXPECT_EQ(written(first, 0, 16), frames_from(0, 16));
  EXPECT_EQ(written(second, 0, 20), frames_from(16, 20));
  EXPECT_TRUE(first.is_rendered(17));
  EXPECT_FALSE(first.is_written(17));
  EXPECT_FALSE(first.is_rendered(18));
  EXPECT_EQ(written(first, 30, 40), frames_from(32, 40));
}

}  // namespace previz::post::frames_to_render_test
