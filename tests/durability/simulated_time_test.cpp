// The simulated time itself, which every promise of the simulated day rests on.
#include "tests/durability/simulated_time.hpp"
#include "tests/support/test.hpp"

#include <poll.h>

#include "drivers/host_clock.hpp"

namespace previz::test::simulated_time_test {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t second = 1'000'000'000, noon = 1'790'000'000 * second;
// Looks at the clock take some nanoseconds each.
constexpr auto looks = 10us;

TEST(SimulatedTimeTest, HoursOfWaitsOfEveryKindPassAtOnceAndTakeExactlyAsLong) {
  const Clock::time_point real_begin = Clock::now();
  {
    const SimulatedTime time(noon);
    auto expect_passed = [last = Clock::now()](std::chrono::nanoseconds wait) mutable {
      const Clock::time_point now = Clock::now();
      EXPECT_GE(now - last, wait);
      EXPECT_LT(now - std::exchange(last, now), wait + looks);
    };
    std::this_thread::sleep_for(3h);
    expect_passed(3h);
    std::mutex mutex;
    std::condition_variable never;
    std::unique_lock lock(mutex);
    EXPECT_EQ(never.wait_for(lock, 2h), std::cv_status::timeout);
    expect_passed(2h);
    std::promise<void> promise;
    EXPECT_EQ(promise.get_future().wait_for(1h), std::future_status::timeout);
    expect_passed(1h);
    EXPECT_EQ(poll(nullptr, 0, 60'000), 0);
    expect_passed(60s);
  }
  EXPECT_LT(Clock::now() - real_begin, 1min);
}

TEST(SimulatedTimeTest, AThreadThatIsSignalledRunsBeforeTimeGoesOn) {
  const SimulatedTime time(noon);
  std::mutex mutex;
  std::condition_variable news;
  int rounds = 0;
  std::int64_t latest_ns = 0;
  std::jthread other([&] {
    std::unique_lock lock(mutex);
    for (int i = 1; i <= 1000; ++i) {
      ASSERT_TRUE(news.wait_for(lock, 1h, [&] { return rounds >= i; }));
      latest_ns = std::max(latest_ns, time.now_ns() % second);
    }
  });
  const std::int64_t begin_ns = time.now_ns();
  for (int i = 1; i <= 1000; ++i) {
    time.sleep_exactly_until(begin_ns + i * second);
    const std::lock_guard lock(mutex);
    ++rounds;
    news.notify_one();
  }
  other.join();
  EXPECT_LT(latest_ns, begin_ns % second + 1'000'000);
}

TEST(SimulatedTimeTest, StepsAndASuspensionMoveTheOtherClocksAlone) {
  SimulatedTime time(noon);
  const auto wall = [] { return std::chrono::system_clock::now().time_since_epoch(); };
  EXPECT_EQ(std::chrono::floor<std::chrono::seconds>(wall()).count() * second, noon);
  const std::int64_t before_ns = monotonic_ns();
  time.step_wall_clock(-10 * second);
  EXPECT_NEAR(double(wall().count() - noon), -10e9, 1e6);
  time.suspend(600 * second);
  timespec boot{};
  clock_gettime(CLOCK_BOOTTIME, &boot);
  EXPECT_NEAR(double(boot.tv_sec * second + boot.tv_nsec - before_ns), 600e9, 1e6);
  EXPECT_NEAR(double(wall().count() - noon), 590e9, 1e6);
  EXPECT_NEAR(double(monotonic_ns() - before_ns), 0, 1e6);
}

TEST(SimulatedTimeTest, WaitsThatAreCoalescedEndLateAndTogether) {
  SimulatedTime time(noon);
  time.coalesce_waits(second);
  const std::int64_t begin_ns = time.now_ns();
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(time.now_ns() / 1000 * 1000, (begin_ns / second + 1) * second);
  time.sleep_exactly_until(time.now_ns() + 1000);
  EXPECT_LT(time.now_ns() % second, 2000);
}

}  // namespace previz::test::simulated_time_test
