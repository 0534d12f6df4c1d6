// What people see while a long job runs.
#include "daemon/core/output/progress.hpp"

#include "tests/support/test.hpp"

namespace previz::output::progress_test {

TEST(Progress, DurationsReadLikeAClock) {
  EXPECT_EQ(duration_words(-1), "0 s");
  EXPECT_EQ(duration_words(59.4), "59 s");
  EXPECT_EQ(duration_words(59.6), "1:00");
  EXPECT_EQ(duration_words(185), "3:05");
  EXPECT_EQ(duration_words(7385), "2:03:05");
}

TEST(Progress, PlainLinesTellRateAndTimeLeft) {
  std::ostringstream out;
  Progress progress(out, false, 4, 100);
  progress.sample(0, 3, 16, 105);  // not on a terminal: nothing
  progress.frame_done("frame 0: 16 samples", 110);
  progress.note("light: 3 % overexposed");
  progress.frame_done("frame 1: 16 samples", 116);
  EXPECT_EQ(out.str(),
            "frame 0: 16 samples (1 of 4, 10.0 s/frame, 30 s left)\n"
            "light: 3 % overexposed\n"
            "frame 1: 16 samples (2 of 4, 8.0 s/frame, 16 s left)\n");
}

TEST(Progress, TerminalRewritesOneLine) {
  std::ostringstream out;
  Progress progress(out, true, 2, 0);
  progress.sample(7, 8, 16, 0.1);
  progress.frame_done("frame 7: 16 samples", 0.2);
  EXPECT_EQ(out.str(),
            "frame 7: 8/16 samples; 0 of 2 frames, 5.0 frames/s, 1 s left"
            "\r\x1b[K"
            "frame 7: 16 samples (1 of 2, 5.0 frames/s, 1 s left)\n");
}

// A picture that is averaged with its neighbours is finished when these are rendered.
TEST(Progress, CountsTheWorkOfNeighbours) {
  std::ostringstream out;
  Progress progress(out, false, 1, 0, 2);
  progress.frame_rendered(2, 10);
  progress.frame_rendered(3, 20);
  progress.frame_rendered(4, 30);
  progress.frame_done("frame 3: 16 samples", 31);
  EXPECT_EQ(out.str(),
            "frame 2: rendered (1 of 3, 10.0 s/frame, 20 s left)\n"
            "frame 3: rendered (2 of 3, 10.0 s/frame, 10 s left)\n"
            "frame 4: rendered (3 of 3, 10.0 s/frame, 1 s left)\n"
            "frame 3: 16 samples (1 of 1, 10.3 s/frame, 0 s left)\n");
}

TEST(ShareProgress, TellsTheShareOfTheWorkAndTheTimeLeft) {
  std::ostringstream plain, terminal;
  for (std::ostringstream* out : {&plain, &terminal}) {
    ShareProgress progress(*out, out == &terminal, 200, 100);
    progress.worked("reference", 50, 110);
    progress.step_done("reference", 110);
  }
  EXPECT_EQ(plain.str(), "reference (25 %, 30 s left)\n");
  EXPECT_EQ(terminal.str(),
            "\r\x1b[Kreference (25 %, 30 s left)\r\x1b[Kreference (25 %, 30 s left)\n");
}

TEST(ShareProgress, LeavesSomethingUntilTheLastStep) {
  std::ostringstream out;
  ShareProgress progress(out, false, 200, 100);
  progress.worked("search", 200, 110);
  progress.step_done("search", 110);
  progress.worked("search", 1, 130);
  progress.step_done("search", 130);
  progress.step_done("pictures", 131, true);
  EXPECT_EQ(out.str(),
            "search (99 %, 1 s left)\n"
            "search (99 %, longer than expected)\n"
            "pictures (100 %)\n");
}

}  // namespace previz::output::progress_test
