// Waits of tests: each has a limit, and its failure says which condition was missed.
#pragma once

#include "tests/support/test.hpp"

namespace previz::test {

// Everything a test waits for comes within this time even under sanitizers on a busy machine, or
// never.
inline constexpr std::chrono::minutes longest_wait{2};

struct WaitedInVain : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Asks every two milliseconds whether the condition holds. The failure names `what` was waited for:
// "take 2 is finished".
[[nodiscard]] inline testing::AssertionResult wait_until(
    const std::string& what, const std::function<bool()>& condition,
    std::chrono::duration<double> limit = longest_wait) {
  const auto begin = std::chrono::steady_clock::now();
  while (!condition()) {
    if (std::chrono::steady_clock::now() - begin > limit)
      return testing::AssertionFailure()
             << "waited " << limit.count() << " s in vain until " << what;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return testing::AssertionSuccess();
}

// The same for code that cannot leave its test by ASSERT_TRUE: it throws WaitedInVain. `seen` adds
// to the message what there was instead.
inline void must_come(
    const std::string& what, const std::function<bool()>& condition,
    const std::function<std::string()>& seen = [] { return std::string(); }) {
  const testing::AssertionResult result = wait_until(what, condition);
  if (!result) throw WaitedInVain(result.message() + std::string("; there was\n") + seen());
}

}  // namespace previz::test
