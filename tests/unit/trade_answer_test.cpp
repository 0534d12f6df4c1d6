// The search for settings, on simulated costs and errors.
#include "daemon/trade/answer.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace previz::trade {
namespace trade_answer_test {

TEST(TradeAnswer, StepsAreThoseThatNoOtherBeats) {
  const std::vector<TradeStep> best = best_steps({{{1, 1, true}, 0.030, 0.08},
                                                  {{4, 1, true}, 0.060, 0.05},
                                                  {{1, 1, false}, 0.025, 0.20},
                                                  {{4, 0.5, true}, 0.020, 0.07},
                                                  {{1, 0.25, true}, 0.008, 0.30}});
  ASSERT_EQ(best.size(), 3u);
  EXPECT_EQ(best[0].making, (Making{4, 1, true}));
  EXPECT_EQ(best[1].making, (Making{4, 0.5, true}));  // cheaper and nearer than one of the whole
  EXPECT_EQ(best[2].making, (Making{1, 0.25, true}));
}

TEST(TradeAnswer, ManyStepsAreThinnedAndKeepTheirEnds) {
  std::vector<TradeStep> all;
  for (int i = 0; i < 30; ++i) all.push_back({{30 - i, 1, true}, std::pow(0.9, i), 0.01 * (i + 1)});
  const std::vector<TradeStep> best = best_steps(all);
  EXPECT_EQ(best.size(), 8u);
  EXPECT_EQ(best.front().making.samples, 30);
  EXPECT_EQ(best.back().making.samples, 1);
}

// error^2 = 0.01^2 + 0.08^2 / samples.
TEST(TradeAnswer, SamplesFollowFromTwoErrors) {
  const auto error = [](int samples) { return std::sqrt(1e-4 + 0.0064 / samples); };
  EXPECT_NEAR(samples_for(0.02, 4, error(4), 16, error(16)), 22, 1);  // 0.0064 / (4e-4 - 1e-4)
  EXPECT_EQ(samples_for(0.009, 4, error(4), 16, error(16)), 0) << "below the bias";
  EXPECT_EQ(samples_for(0.5, 4, error(4), 16, error(16)), 1);
}

}  // namespace trade_answer_test
}  // namespace previz::trade
