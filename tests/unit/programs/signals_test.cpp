// SIGINT and SIGTERM become a stop request that the pipeline sees.
#include "daemon/signals.hpp"

#include <unistd.h>

#include <csignal>

#include "daemon/pipeline/stages.hpp"
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
        kill(getpid(), SIGINT);
        for (;;) pause();
      },
      testing::ExitedWithCode(128 + SIGINT), "");
}

}  // namespace previz::signals_test
