#include "tests/truth/agreement.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "drivers/error.hpp"

namespace previz::truth {
namespace {

constexpr int tile_px = 16;
constexpr double beyond_standard_errors = 4;

struct BlockEstimate {
  glm::dvec3 mean{0};
  glm::dvec3 variance_of_mean{0};
};

std::vector<BlockEstimate> block_estimates(const Scrambles& s) {
  const int columns = s.width / tile_px, rows = s.height / tile_px;
  const auto n = static_cast<double>(s.pictures.size());
  std::vector<BlockEstimate> out;
  for (int by = 0; by < rows; ++by) {
    for (int bx = 0; bx < columns; ++bx) {
      std::vector<glm::dvec3> means;
      for (const auto& picture : s.pictures) {
        glm::dvec3 sum(0);
        for (int y = 0; y < tile_px; ++y) {
          for (int x = 0; x < tile_px; ++x) {
            sum +=
                picture[static_cast<std::size_t>((by * tile_px + y) * s.width + bx * tile_px + x)];
          }
        }
        means.push_back(sum / static_cast<double>(tile_px * tile_px));
      }
      BlockEstimate e;
      for (const glm::dvec3& mean : means) e.mean += mean / n;
      for (const glm::dvec3& mean : means) {
        e.variance_of_mean += (mean - e.mean) * (mean - e.mean) / (n * (n - 1));
      }
      out.push_back(e);
    }
  }
  return out;
}

void require_comparable(const Scrambles& a, const Scrambles& b) {
  const auto pixels = static_cast<std::size_t>(a.width) * static_cast<std::size_t>(a.height);
  const auto fits = [&](const auto& picture) { return picture.size() == pixels; };
  if (a.width != b.width || a.height != b.height ||
      !std::all_of(a.pictures.begin(), a.pictures.end(), fits) ||
      !std::all_of(b.pictures.begin(), b.pictures.end(), fits)) {
    throw Error("agreement: the pictures differ in size");
  }
  if (std::min(a.pictures.size(), b.pictures.size()) < 16) {
    throw Error("agreement: at least 16 scrambles of each estimator are needed, got " +
                std::to_string(a.pictures.size()) + " and " + std::to_string(b.pictures.size()));
  }
  if (a.width < tile_px || a.height < tile_px) {
    throw Error("agreement: the pictures have no whole block of 16x16 pixels");
  }
}

}  // namespace

Agreement agreement(const Scrambles& a, const Scrambles& b) {
  require_comparable(a, b);
  const std::vector<BlockEstimate> of_a = block_estimates(a), of_b = block_estimates(b);
  Agreement out;
  out.blocks = static_cast<int>(of_a.size());
  out.degrees_of_freedom = static_cast<int>(a.pictures.size() + b.pictures.size()) - 2;
  out.allowed_beyond = binomial_quantile(
      out.blocks, student_two_sided_tail(beyond_standard_errors, out.degrees_of_freedom), 0.999);
  out.allowed_mean_z = 4 / std::sqrt(static_cast<double>(out.blocks));
  out.agree = true;
  for (int c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < of_a.size(); ++i) {
      const double rounding = 1e-6 * (std::abs(of_a[i].mean[c]) + std::abs(of_b[i].mean[c])) / 2;
      const double error = std::sqrt(of_a[i].variance_of_mean[c] + of_b[i].variance_of_mean[c]);
      const double difference = of_a[i].mean[c] - of_b[i].mean[c];
      const double z = difference == 0 ? 0 : difference / std::max(error, rounding);
      // A NaN lies beyond, too.
      if (!(std::abs(z) <= beyond_standard_errors)) ++out.beyond[c];
      out.mean_z[c] += z / out.blocks;
    }
    out.agree = out.agree && out.beyond[c] <= out.allowed_beyond &&
                std::abs(out.mean_z[c]) <= out.allowed_mean_z;
  }
  return out;
}

std::string Agreement::report() const {
  char line[256];
  std::snprintf(line, sizeof line,
                "%s: beyond 4 standard errors %d/%d/%d of %d blocks (%d allowed), mean z "
                "%+.3f/%+.3f/%+.3f (%.3f allowed)",
                agree ? "agree" : "DISAGREE", beyond[0], beyond[1], beyond[2], blocks,
                allowed_beyond, mean_z[0], mean_z[1], mean_z[2], allowed_mean_z);
  return line;
}

double student_two_sided_tail(double x, int degrees_of_freedom) {
  // Simpson's rule over the density from 0 to x; smooth, 2000 intervals leave below 1e-12.
  const double n = degrees_of_freedom;
  const double scale =
      std::exp(std::lgamma((n + 1) / 2) - std::lgamma(n / 2)) / std::sqrt(n * std::acos(-1.0));
  const auto density = [&](double t) { return scale * std::pow(1 + t * t / n, -(n + 1) / 2); };
  const int intervals = 2000;
  const double step = x / intervals;
  double sum = density(0) + density(x);
  for (int i = 1; i < intervals; ++i) sum += (i % 2 ? 4 : 2) * density(i * step);
  return 1 - 2 * sum * step / 3;
}

int binomial_quantile(int n, double p, double probability) {
  double cumulative = 0;
  for (int k = 0; k < n; ++k) {
    const double log_choose =
        std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0);
    cumulative += std::exp(log_choose + k * std::log(p) + (n - k) * std::log1p(-p));
    if (cumulative >= probability) return k;
  }
  return n;
}

}  // namespace previz::truth
