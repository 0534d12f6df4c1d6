#include "daemon/tools/calibrate/lens/bundle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/least_squares.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

using Selection = std::vector<std::vector<bool>>;
using Residuals = std::vector<std::vector<glm::dvec2>>;

constexpr int most_rejections = 10;
constexpr double rejection_sigmas = 4.5;
constexpr double least_rejection_px = 1;
// This is the median of |e| for a two-dimensional Gaussian of deviation 1 (Rayleigh): sqrt(2 ln 2).
constexpr double rayleigh_median = 1.1774;

// If most of a view does not fit, the rest of the view cannot be trusted either.
void leave_out_poor_views(Selection& used) {
  for (auto& view : used)
    if (2 * std::ranges::count(view, true) < std::ssize(view)) view.assign(view.size(), false);
}

// The step of central differences is where truncation and rounding errors meet: about the cube root
// of a double's precision times the value's own scale.
constexpr double relative_step = 1e-5;

class Problem {
 public:
  // The normal equations are in the order lens, pose of view 0, 1, ...
  struct Equations {
    double cost = 0;      // infinite if a used corner cannot be seen
    Residuals residuals;  // of every corner, used or not
    cv::Mat1d information, gradient;
  };

  Selection used;

  // Selects the corners that the lens can see at the start; something mistaken for a board may
  // start behind the camera.
  Problem(const std::vector<View>& views, const Projection& projection, const Bundle& start)
      : views_(views), projection_(projection) {
    const Residuals seen = residuals(start);
    for (const auto& view : seen) {
      used.emplace_back();
      for (const glm::dvec2& residual : view) used.back().push_back(std::isfinite(residual.x));
    }
    leave_out_poor_views(used);
  }

  Equations evaluate(const Bundle& bundle) const {
    Equations equations{0, residuals(bundle), {}, {}};
    for (std::size_t v = 0; v < used.size(); ++v)
      for (std::size_t i = 0; i < used[v].size(); ++i)
        if (used[v][i])
          equations.cost += glm::dot(equations.residuals[v][i], equations.residuals[v][i]);
    return equations;
  }

  Residuals residuals(const Bundle& bundle) const {
    Residuals all(views_.size());
    for (std::size_t v = 0; v < views_.size(); ++v)
      for (std::size_t i = 0; i < views_[v].points.size(); ++i) {
        const auto pixel = projection_(bundle.lens, in_camera(bundle, v, i));
        all[v].push_back(pixel ? views_[v].pixels[i] - *pixel : glm::dvec2(HUGE_VAL));
      }
    return all;
  }

  void linearise(const Bundle& bundle, Equations& equations) const {
    const int lens_size = int(bundle.lens.size());
    const int size = lens_size + 6 * int(views_.size());
    equations.information = cv::Mat1d::zeros(size, size);
    equations.gradient = cv::Mat1d::zeros(size, 1);
    cv::Mat1d row(2, lens_size + 6);
    for (std::size_t v = 0; v < views_.size(); ++v) {
      const int first = lens_size + 6 * int(v);
      const auto column = [&](int c) { return c < lens_size ? c : first + c - lens_size; };
      for (std::size_t i = 0; i < used[v].size(); ++i) {
        if (!used[v][i]) continue;
        derivative(bundle, v, i, row);
        const glm::dvec2& off = equations.residuals[v][i];
        for (int a = 0; a < row.cols; ++a) {
          equations.gradient(column(a)) += row(0, a) * off.x + row(1, a) * off.y;
          for (int b = 0; b <= a; ++b)
            equations.information(column(a), column(b)) +=
                row(0, a) * row(0, b) + row(1, a) * row(1, b);
        }
      }
    }
    cv::completeSymm(equations.information, true);
  }

  static Bundle moved(Bundle bundle, const cv::Mat1d& step) {
    const int lens_size = int(bundle.lens.size());
    for (int p = 0; p < lens_size; ++p) bundle.lens[std::size_t(p)] += step(p);
    for (std::size_t v = 0; v < bundle.poses.size(); ++v) {
      const double* by = step[lens_size + 6 * int(v)];
      tracking::CameraFromWorld& pose = bundle.poses[v];
      pose.rotation =
          tracking::orthonormal(tracking::rotation_by({by[0], by[1], by[2]}) * pose.rotation);
      pose.translation += glm::dvec3(by[3], by[4], by[5]);
    }
    return bundle;
  }

 private:
  glm::dvec3 in_camera(const Bundle& bundle, std::size_t view, std::size_t i) const {
    const tracking::CameraFromWorld& pose = bundle.poses[view];
    return pose.rotation * views_[view].points[i] + pose.translation;
  }

  // Computes the derivative of the projected pixel by the lens and by a small motion of the pose.
  void derivative(const Bundle& bundle, std::size_t view, std::size_t i, cv::Mat1d& row) const {
    const glm::dvec3 x = in_camera(bundle, view, i);
    std::vector<double> lens = bundle.lens;
    const int lens_size = int(lens.size());
    for (int p = 0; p < lens_size; ++p) {
      double& value = lens[std::size_t(p)];
      const double at = value, step = relative_step * std::max(1.0, std::abs(at));
      const glm::dvec2 d = difference(
          [&](double offset) {
            value = at + offset;
            return projection_(lens, x);
          },
          step);
      value = at;
      row(0, p) = d.x;
      row(1, p) = d.y;
    }
    glm::dvec2 by_point[3];
    for (int c = 0; c < 3; ++c)
      by_point[c] = difference(
          [&](double offset) {
            glm::dvec3 y = x;
            y[c] += offset;
            return projection_(bundle.lens, y);
          },
          relative_step * glm::length(x));
    const glm::dvec3 arm = x - bundle.poses[view].translation;
    for (int k = 0; k < 2; ++k) {
      // A rotation w moves the point by w cross arm, a translation by itself.
      const glm::dvec3 g(by_point[0][k], by_point[1][k], by_point[2][k]);
      const glm::dvec3 by_turn = glm::cross(arm, g);
      for (int c = 0; c < 3; ++c) {
        row(k, lens_size + c) = by_turn[c];
        row(k, lens_size + 3 + c) = g[c];
      }
    }
  }

  template <typename At>
  static glm::dvec2 difference(const At& at, double step) {
    const auto above = at(step), below = at(-step);
    // The point is seen from one side only: it is at the very edge of what the lens sees, and the
    // corner gets no derivative.
    if (!above || !below) return glm::dvec2(0);
    return (*above - *below) / (2 * step);
  }

  const std::vector<View>& views_;
  const Projection& projection_;
};

double rms(const Residuals& residuals, std::size_t corners) {
  double sum = 0;
  for (const auto& view : residuals)
    for (const glm::dvec2& residual : view) sum += glm::dot(residual, residual);
  return std::sqrt(sum / double(corners));
}

double robust_sigma_px(const Residuals& residuals, const Selection& used) {
  std::vector<double> lengths;
  for (std::size_t v = 0; v < residuals.size(); ++v)
    for (std::size_t i = 0; i < residuals[v].size(); ++i)
      if (used[v][i]) lengths.push_back(glm::length(residuals[v][i]));
  const auto middle = lengths.begin() + std::ptrdiff_t(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle / rayleigh_median;
}

Selection within(const Residuals& residuals, double limit_px) {
  Selection used(residuals.size());
  for (std::size_t v = 0; v < residuals.size(); ++v)
    for (const glm::dvec2& residual : residuals[v])
      used[v].push_back(glm::length(residual) <= limit_px);
  leave_out_poor_views(used);
  return used;
}

// Returns the block of `size` parameters from `first` on, row-major.
std::vector<double> block(const cv::Mat1d& matrix, int first, int size) {
  std::vector<double> values;
  for (int row = first; row < first + size; ++row)
    for (int column = first; column < first + size; ++column) values.push_back(matrix(row, column));
  return values;
}

// Returns the covariance of all parameters, (J^T J)^-1 sigma^2.
cv::Mat1d covariance(const Problem& problem, const BundleFit& fit) {
  Problem::Equations equations{0, fit.residuals, {}, {}};
  problem.linearise(fit.bundle, equations);
  const auto inverse = tracking::inverse_of(equations.information);
  if (!inverse)
    throw Error(
        "the views are too alike to fit a lens: film the board tilted, close, and all over the "
        "picture");
  return *inverse * (fit.sigma_px * fit.sigma_px);
}

}  // namespace

BundleFit fit_bundle(const std::vector<View>& views, Bundle start, const Projection& projection) {
  Problem problem(views, projection, start);
  BundleFit fit;
  fit.bundle = std::move(start);
  double squares = 0;
  for (int round = 0; round < most_rejections; ++round) {
    auto minimum = tracking::least_squares(problem, std::move(fit.bundle), {.most_trials = 200});
    if (minimum.why == tracking::Stopped::outside)
      throw Error("the board's corners lie where no lens can see them");
    fit.bundle = std::move(minimum.at);
    fit.residuals = std::move(minimum.equations.residuals);
    squares = minimum.equations.cost;
    fit.used = problem.used;
    const double limit = rejection_sigmas * robust_sigma_px(fit.residuals, fit.used);
    problem.used = within(fit.residuals, std::max(limit, least_rejection_px));
    if (problem.used == fit.used) break;
  }
  problem.used = fit.used;  // also where the last round would still change it

  std::size_t views_used = 0;
  for (std::size_t v = 0; v < fit.used.size(); ++v) {
    const auto count = std::size_t(std::ranges::count(fit.used[v], true));
    fit.corners += fit.used[v].size();
    fit.corners_used += count;
    if (count) ++views_used;
    if (!count) fit.views_left_out.push_back(v);
  }
  const double freedom =
      2.0 * double(fit.corners_used) - double(fit.bundle.lens.size()) - 6.0 * double(views_used);
  if (!(freedom > 0)) throw Error("fewer corners than lens parameters; film more views");
  fit.rms_px = std::sqrt(squares / double(fit.corners_used));
  fit.rms_all_px = rms(fit.residuals, fit.corners);
  fit.sigma_px = std::sqrt(squares / freedom);
  const cv::Mat1d all = covariance(problem, fit);
  const int lens_size = int(fit.bundle.lens.size());
  fit.lens_covariance = block(all, 0, lens_size);
  for (int v = 0; v < int(views.size()); ++v)
    fit.pose_covariances.push_back(block(all, lens_size + 6 * v, 6));
  return fit;
}

std::vector<double> lens_sigma(const BundleFit& fit) {
  std::vector<double> sigma;
  const std::size_t size = fit.bundle.lens.size();
  for (std::size_t p = 0; p < size; ++p)
    sigma.push_back(std::sqrt(fit.lens_covariance[p * size + p]));
  return sigma;
}

}  // namespace previz::calibrate
