// SIGINT and SIGTERM become a stop request that the pipeline sees.
#include "daemon/core/program/signals.hpp"

#include <unistd.h>

#include <csignal>

#include "daemon/core/pipeline/stages.hpp"
#include "daemon/core/session/draft.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::signals_test {

TEST(StopOnSignal, EitherSignalStopsARunningPipeline) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const StopOnSignal stop;
    pipeline::Metrics metrics;
    pipeline::Mailbox<int> mailbox;
    std::atomic<bool> started = false;
    pipeline::StageThreads stages(metrics, stop.token());
    stages.source("camera", mailbox, [&]() -> std::optional<int> {
      if (!started.exchange(true)) kill(getpid(), signal);
      return 1;
    });
    stages.sink("display", mailbox, [](int) {});
    stages.wait();  // hangs, and ctest's time-out tells, if the signal does not arrive
    EXPECT_EQ(stop.received(), signal);
    EXPECT_TRUE(stop.token().stop_requested());
  }
}

TEST(StopOnSignal, WithoutASignalNothingIsRequested) {
  const StopOnSignal stop;
  EXPECT_EQ(stop.received(), 0);
  EXPECT_FALSE(stop.token().stop_requested());
}

TEST(StopOnSignalDeathTest, ASecondSignalEndsTheProcessAtOnce) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        const StopOnSignal stop;
        kill(getpid(), SIGINT);
        while (stop.received() == 0) usleep(1000);
        usleep(400'000);  // a second one at once is the same
        kill(getpid(), SIGINT);
        for (;;) pause();
      },
      testing::ExitedWithCode(128 + SIGINT), "");
}

// What keeps a command busy need not hear of the signal: it ends, and nothing half done stays.
TEST(StopOnSignalDeathTest, TheEndOfItsPatienceEndsTheProcessWithoutItsDrafts) {
  GTEST_FLAG_SET(death_test_style, "fast");  // so that both have one directory
  const test::TemporaryDirectory directory;
  const auto work = [&] {
    const StopOnSignal stop(std::chrono::milliseconds(50));
    const session::Draft file(directory / "file");
    const session::DraftFolder folder(directory / "folder");
    session::Draft(directory / "done").put();
    std::ofstream(folder.path() / "frame") << "half of it";
    kill(getpid(), SIGTERM);
    for (int i = 0;; ++i) std::ofstream(folder.path() / std::to_string(i % 100)) << "more";
  };
  EXPECT_EXIT(work(), testing::ExitedWithCode(128 + SIGTERM), "");
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(directory.path()))
    left.push_back(entry.path().filename());
  EXPECT_THAT(left, ElementsAre("done"));
}

}  // namespace previz::signals_test
