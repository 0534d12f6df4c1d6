// The least-squares solver on problems whose minimum is known.
#include "daemon/core/tracking/least_squares.hpp"

#include "tests/support/test.hpp"

namespace previz::tracking::least_squares_test {

using Pair = cv::Vec2d;
using PairEquations = NormalEquations<2>;

// Rosenbrock's valley as residuals 10 (y - x^2) and 1 - x (More, Garbow and Hillstrom 1981, problem
// 1): the minimum is 0 at (1, 1).
struct Valley {
  double beyond_x = HUGE_VAL;  // outside of the domain

  PairEquations evaluate(const Pair& at) const {
    PairEquations sum;
    const cv::Vec2d off(10 * (at[1] - at[0] * at[0]), 1 - at[0]);
    sum.add<2>({20 * at[0], -10, 1, 0}, off);
    sum.cost = at[0] > beyond_x ? HUGE_VAL : off.dot(off);
    return sum;
  }

  static Pair moved(const Pair& from, const cv::Matx21d& step) { return from + Pair(step.val); }
};

TEST(LeastSquares, FindsTheEndOfRosenbrocksValley) {
  const auto minimum = least_squares(Valley(), Pair(-1.2, 1), {});
  EXPECT_EQ(minimum.why, Stopped::settled);
  EXPECT_NEAR(minimum.at[0], 1, 1e-9);
  EXPECT_NEAR(minimum.at[1], 1, 1e-9);
  EXPECT_LT(minimum.equations.cost, 1e-18);
  EXPECT_LT(minimum.steps, 50);
}

TEST(LeastSquares, StopsAfterTheMostTrials) {
  const auto minimum = least_squares(Valley(), Pair(-1.2, 1), {.most_trials = 3});
  EXPECT_EQ(minimum.why, Stopped::trials);
  EXPECT_LE(minimum.steps, 3);
  EXPECT_LT(minimum.equations.cost, Valley().evaluate({-1.2, 1}).cost);
}

TEST(LeastSquares, RefusesAStartOutsideOfTheDomain) {
  const auto minimum = least_squares(Valley{0}, Pair(2, 1), {});
  EXPECT_EQ(minimum.why, Stopped::outside);
  EXPECT_EQ(minimum.at, Pair(2, 1));
  EXPECT_EQ(minimum.steps, 0);
}

TEST(LeastSquares, StaysWithinTheDomain) {
  const auto minimum = least_squares(Valley{0.5}, Pair(-1.2, 1), {});
  EXPECT_LE(minimum.at[0], 0.5);
  EXPECT_GT(minimum.at[0], 0.4);
  EXPECT_TRUE(std::isfinite(minimum.equations.cost));
}

// A straight line through points, whose solution and covariance are known in closed form.
struct Straight {
  std::vector<Pair> points;

  PairEquations evaluate(const Pair& line) const {
    PairEquations sum;
    for (const Pair& point : points) {
      const double off = point[1] - line[0] - line[1] * point[0];
      sum.add(cv::Matx12d(1, point[0]), cv::Matx<double, 1, 1>(off));
      sum.cost += off * off;
    }
    return sum;
  }

  static Pair moved(const Pair& from, const cv::Matx21d& step) { return from + Pair(step.val); }
};

TEST(LeastSquares, FitsALineWithItsCovariance) {
  const Straight line{{{0, 1}, {1, 2}, {2, 4}, {3, 4}}};
  const auto minimum = least_squares(line, Pair(100, -7), {});
  EXPECT_NEAR(minimum.at[0], 1.1, 1e-9);
  EXPECT_NEAR(minimum.at[1], 1.1, 1e-9);
  EXPECT_NEAR(minimum.equations.cost, 0.7, 1e-12);
  const auto covariance = inverse_of(minimum.equations.information);
  ASSERT_TRUE(covariance);
  EXPECT_NEAR((*covariance)(0, 0), 0.7, 1e-12);
  EXPECT_NEAR((*covariance)(0, 1), -0.3, 1e-12);
  EXPECT_NEAR((*covariance)(1, 1), 0.2, 1e-12);
}

TEST(LeastSquares, ASingularProblemHasAMinimumButNoCovariance) {
  const Straight one_place{{{2, 4}, {2, 6}}};
  const auto minimum = least_squares(one_place, Pair(0, 0), {});
  EXPECT_NEAR(minimum.at[0] + 2 * minimum.at[1], 5, 1e-6);
  EXPECT_FALSE(inverse_of(minimum.equations.information));
  EXPECT_FALSE(
      damped_step(minimum.equations.information, minimum.equations.gradient, /*damping=*/0));
}

TEST(LeastSquares, HoldsAnUnknownThatNothingDetermines) {
  const Straight at_zero{{{0, 4}, {0, 6}}};
  const auto minimum = least_squares(at_zero, Pair(0, 3), {});
  EXPECT_NEAR(minimum.at[0], 5, 1e-9);
  EXPECT_EQ(minimum.at[1], 3);
  const auto covariance = inverse_of(minimum.equations.information);
  ASSERT_TRUE(covariance);
  EXPECT_NEAR((*covariance)(0, 0), 0.5, 1e-12);
  EXPECT_EQ((*covariance)(1, 1), 0);
}

// Every step is uphill: the gradient has the wrong sign.
struct Uphill : Straight {
  PairEquations evaluate(const Pair& line) const {
    PairEquations sum = Straight::evaluate(line);
    sum.gradient *= -1;
    return sum;
  }
};

TEST(LeastSquares, IsStuckWhereNoStepLessensTheCost) {
  const Uphill uphill{{{{0, 1}, {1, 2}, {2, 4}}}};
  const auto minimum = least_squares(uphill, Pair(1e3, 0), {});
  EXPECT_EQ(minimum.why, Stopped::stuck);
  EXPECT_EQ(minimum.at, Pair(1e3, 0));
  EXPECT_EQ(minimum.steps, 0);
}

}  // namespace previz::tracking::least_squares_test
