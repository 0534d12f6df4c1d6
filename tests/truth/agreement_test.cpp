// The test of agreement must accept estimators that agree and reject those that do not.
#include "tests/truth/agreement.hpp"
#include "tests/support/test.hpp"

#include "tests/truth/cpu_random.hpp"

namespace previz::truth::agreement_test {

// Every pixel 1 +- 0.2 (uniform noise), 160x128 = 10x8 blocks; `bias` is added to one channel of
// the blocks whose index is below `biased_blocks`.
Scrambles noisy(std::uint64_t seed, double bias = 0, int biased_blocks = 0) {
  Scrambles s{160, 128, {}};
  for (std::uint64_t n = 0; n < 16; ++n) {
    Random random(seed, n);
    std::vector<glm::dvec3> picture;
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) {
        const double value = 1 + 0.2 * (2 * random.uniform() - 1);
        const bool biased = (y / 16) * 10 + x / 16 < biased_blocks;
        picture.emplace_back(value, value + (biased ? bias : 0), value);
      }
    }
    s.pictures.push_back(std::move(picture));
  }
  return s;
}
// Standard error of a block's difference: sqrt(2/16) * (0.2 / sqrt(3)) / 16.
const double block_standard_error = std::sqrt(2.0 / 16) * 0.2 / std::sqrt(3.0) / 16;

TEST(Agreement, AcceptsTheSameDistribution) {
  const Agreement a = agreement(noisy(1), noisy(2));
  EXPECT_EQ(a.blocks, 80);
  EXPECT_EQ(a.degrees_of_freedom, 30);
  EXPECT_TRUE(a.agree) << a.report();
}

TEST(Agreement, RejectsASmallBiasEverywhere) {
  // One standard error in every block: no block stands out, the mean z of 1 does (0.447 allowed).
  const Agreement a = agreement(noisy(1), noisy(2, block_standard_error, 80));
  EXPECT_FALSE(a.agree) << a.report();
  EXPECT_LE(a.beyond[1], a.allowed_beyond);
  EXPECT_LT(a.mean_z[1], -a.allowed_mean_z);
}

TEST(Agreement, RejectsALargeBiasInAFewBlocks) {
  const Agreement a = agreement(noisy(1), noisy(2, 10 * block_standard_error, 3));
  EXPECT_FALSE(a.agree) << a.report();
  EXPECT_EQ(a.beyond[1], 3);
  EXPECT_EQ(a.beyond[0], 0);
}

TEST(Agreement, RejectsNotANumberAndNoiselessDifferences) {
  Scrambles a = noisy(1);
  for (auto& picture : a.pictures) picture[0].x = std::nan("");
  EXPECT_FALSE(agreement(a, noisy(2)).agree);
  Scrambles flat{16, 16, std::vector(16, std::vector<glm::dvec3>(256, glm::dvec3(1)))};
  Scrambles other = flat;
  EXPECT_TRUE(agreement(flat, other).agree);
  for (auto& picture : other.pictures) picture.assign(256, glm::dvec3(1.001));
  EXPECT_FALSE(agreement(flat, other).agree);
}

TEST(Agreement, RefusesWhatItCannotJudge) {
  Scrambles few = noisy(1);
  few.pictures.pop_back();
  EXPECT_THROW(agreement(few, noisy(2)), Error);
  Scrambles narrow = noisy(1);
  narrow.width = 80;
  EXPECT_THROW(agreement(narrow, noisy(2)), Error);
}

TEST(Agreement, TailsOfTheDistributions) {
  // Tables: t(30) beyond 2.750 two-sided 0.01; binomial(100, 0.01): P(X <= 5) = 0.99947.
  EXPECT_NEAR(student_two_sided_tail(2.750, 30), 0.01, 1e-5);
  EXPECT_NEAR(student_two_sided_tail(0, 30), 1, 1e-12);
  EXPECT_EQ(binomial_quantile(100, 0.01, 0.999), 5);
  EXPECT_EQ(binomial_quantile(80, 3.8e-4, 0.999), 1);
}

}  // namespace previz::truth::agreement_test
