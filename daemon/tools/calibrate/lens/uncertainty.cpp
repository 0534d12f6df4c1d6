#include "daemon/tools/calibrate/lens/uncertainty.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <opencv2/core.hpp>

namespace previz::calibrate {
namespace {

struct Sensitivity {
  glm::dvec2 pixel;
  cv::Mat1d by_lens;  // 2 x parameters
  cv::Matx<double, 2, 3> by_turn;
};

std::optional<Sensitivity> sensitivity(const std::vector<double>& lens,
                                       const Projection& projection, const glm::dvec3& ray) {
  const auto pixel = projection(lens, ray);
  if (!pixel) return std::nullopt;
  Sensitivity s{*pixel, cv::Mat1d(2, int(lens.size())), {}};
  constexpr double step = 1e-6;
  std::vector<double> changed = lens;
  for (std::size_t p = 0; p < lens.size(); ++p) {
    const double size = step * std::max(1.0, std::abs(lens[p]));
    changed[p] = lens[p] + size;
    const auto moved = projection(changed, ray);
    changed[p] = lens[p];
    if (!moved) return std::nullopt;
    s.by_lens(0, int(p)) = (moved->x - pixel->x) / size;
    s.by_lens(1, int(p)) = (moved->y - pixel->y) / size;
  }
  for (int c = 0; c < 3; ++c) {
    glm::dvec3 axis(0);
    axis[c] = step;
    const auto moved = projection(lens, ray + glm::cross(axis, ray));
    if (!moved) return std::nullopt;
    s.by_turn(0, c) = (moved->x - pixel->x) / step;
    s.by_turn(1, c) = (moved->y - pixel->y) / step;
  }
  return s;
}

double longest_axis(const cv::Mat1d& covariance) {
  const double mean = 0.5 * (covariance(0, 0) + covariance(1, 1));
  const double half = 0.5 * (covariance(0, 0) - covariance(1, 1));
  return std::sqrt(std::max(0.0, mean + std::hypot(half, covariance(0, 1))));
}

}  // namespace

std::vector<UncertainPixel> projection_uncertainty(const BundleFit& fit,
                                                   const Projection& projection,
                                                   const std::vector<glm::dvec3>& rays) {
  std::vector<Sensitivity> all;
  cv::Matx33d turns = cv::Matx33d::zeros();
  cv::Mat1d mixed = cv::Mat1d::zeros(3, int(fit.bundle.lens.size()));
  for (const glm::dvec3& ray : rays)
    if (auto s = sensitivity(fit.bundle.lens, projection, ray)) {
      turns += s->by_turn.t() * s->by_turn;
      mixed += cv::Mat1d(s->by_turn.t()) * s->by_lens;
      all.push_back(std::move(*s));
    }
  if (all.size() < 2) return {};
  // The implied rotation absorbs most of a change of the lens: turn = -implied * change.
  const cv::Mat1d implied = cv::Mat1d(turns.inv(cv::DECOMP_SVD)) * mixed;
  const int size = int(fit.bundle.lens.size());
  const cv::Mat1d covariance = cv::Mat1d(fit.lens_covariance).reshape(1, size);
  std::vector<UncertainPixel> uncertain;
  for (const Sensitivity& s : all) {
    const cv::Mat1d left = s.by_lens - cv::Mat1d(s.by_turn) * implied;
    uncertain.push_back({s.pixel, longest_axis(left * covariance * left.t())});
  }
  return uncertain;
}

}  // namespace previz::calibrate
