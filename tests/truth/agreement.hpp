// Tests block-wise over independent scrambles whether two estimators agree (README.md,
// "Agreement").
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::truth {

// Independent pictures of the same thing, each row-major width * height, linear radiance.
struct Scrambles {
  int width = 0, height = 0;
  std::vector<std::vector<glm::dvec3>> pictures;  // at least 16
};

struct Agreement {
  int blocks = 0;              // of 16x16 pixels, whole ones only
  int degrees_of_freedom = 0;  // of each block's t
  // Per channel:
  int beyond[3] = {};         // blocks whose difference exceeds 4 standard errors
  int allowed_beyond = 0;     // 99.9 % quantile of their number if the estimators agree
  double mean_z[3] = {};      // mean signed z
  double allowed_mean_z = 0;  // 4 / sqrt(blocks)
  bool agree = false;
  std::string report() const;  // one line
};

// z = (mean a - mean b) / standard error over the scrambles, one a block and channel. Standard
// errors below 1e-6 of the mean (single precision) count as that. Throws previz::Error if the sizes
// differ, there are fewer than 16 scrambles, or no whole block.
Agreement agreement(const Scrambles& a, const Scrambles& b);

// P(|t| > x) of Student's t distribution.
double student_two_sided_tail(double x, int degrees_of_freedom);
// Smallest k with P(X <= k) >= probability for X binomial(n, p).
int binomial_quantile(int n, double p, double probability);

}  // namespace previz::truth
