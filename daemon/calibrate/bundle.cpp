#include "daemon/calibrate/bundle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <opencv2/core.hpp>

#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

using Selection = std::vector<std::vector<bool>>;

constexpr int most_iterations = 200;
constexpr int most_rejections = 10;
constexpr double rejection_sigmas = 4.5;
constexpr double least_rejection_px = 1;
// This is the median of |e| for a two-dimensional Gaussian of deviation 1 (Rayleigh): sqrt(2 ln 2).
constexpr double rayleigh_median = 1.1774;

tracking::CameraFromWorld moved(const tracking::CameraFromWorld& pose, const double* step) {
  const glm::dvec3 turn(step[0], step[1], step[2]);
  const double angle = glm::length(turn);
  const glm::dquat q =
      angle > 0 ? glm::angleAxis(angle, turn / angle) : glm::dquat(1.0, 0.0, 0.0, 0.0);
  return {glm::mat3_cast(glm::normalize(q * glm::quat_cast(pose.rotation))),
          pose.translation + glm::dvec3(step[3], step[4], step[5])};
}

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
  Problem(const std::vector<View>& views, const Projection& projection)
      : views_(views), projection_(projection) {}

  // Returns the residuals of every corner, used or not; nothing if a used corner cannot be seen.
  std::optional<std::vector<std::vector<glm::dvec2>>> residuals(const Bundle& bundle,
                                                                const Selection& used) const {
    std::vector<std::vector<glm::dvec2>> all(views_.size());
    for (std::size_t v = 0; v < views_.size(); ++v)
      for (std::size_t i = 0; i < views_[v].points.size(); ++i) {
        const auto pixel = projection_(bundle.lens, in_camera(bundle, v, i));
        if (!pixel && used[v][i]) return std::nullopt;
        all[v].push_back(pixel ? views_[v].pixels[i] - *pixel : glm::dvec2(HUGE_VAL));
      }
    return all;
  }

  // Selects the corners that the lens can see; something mistaken for a board may start behind the
  // camera.
  Selection visible(const Bundle& bundle) const {
    Selection seen(views_.size());
    for (std::size_t v = 0; v < views_.size(); ++v)
      for (std::size_t i = 0; i < views_[v].points.size(); ++i)
        seen[v].push_back(projection_(bundle.lens, in_camera(bundle, v, i)).has_value());
    leave_out_poor_views(seen);
    return seen;
  }

  static double cost(const std::vector<std::vector<glm::dvec2>>& residuals, const Selection& used) {
    double sum = 0;
    for (std::size_t v = 0; v < used.size(); ++v)
      for (std::size_t i = 0; i < used[v].size(); ++i)
        if (used[v][i]) sum += glm::dot(residuals[v][i], residuals[v][i]);
    return sum;
  }

  // Builds the normal equations in the order lens, pose of view 0, 1, ...: information * step =
  // gradient.
  void linearise(const Bundle& bundle, const Selection& used,
                 const std::vector<std::vector<glm::dvec2>>& residuals, cv::Mat1d& information,
                 cv::Mat1d& gradient) const {
    const int lens_size = int(bundle.lens.size());
    const int size = lens_size + 6 * int(views_.size());
    information = cv::Mat1d::zeros(size, size);
    gradient = cv::Mat1d::zeros(size, 1);
    cv::Mat1d row(2, lens_size + 6);
    for (std::size_t v = 0; v < views_.size(); ++v) {
      const int first = lens_size + 6 * int(v);
      const auto column = [&](int c) { return c < lens_size ? c : first + c - lens_size; };
      for (std::size_t i = 0; i < used[v].size(); ++i) {
        if (!used[v][i]) continue;
        derivative(bundle, v, i, row);
        for (int a = 0; a < row.cols; ++a) {
          gradient(column(a)) += row(0, a) * residuals[v][i].x + row(1, a) * residuals[v][i].y;
          for (int b = 0; b <= a; ++b)
            information(column(a), column(b)) += row(0, a) * row(0, b) + row(1, a) * row(1, b);
        }
      }
    }
    cv::completeSymm(information, true);
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

Bundle stepped(const Bundle& bundle, const cv::Mat1d& step) {
  Bundle next = bundle;
  const int lens_size = int(bundle.lens.size());
  for (int p = 0; p < lens_size; ++p) next.lens[std::size_t(p)] += step(p);
  for (std::size_t v = 0; v < bundle.poses.size(); ++v)
    next.poses[v] = moved(bundle.poses[v], step[lens_size + 6 * int(v)]);
  return next;
}

// Returns the scales that bring the diagonal to 1, so that pixels and polynomial coefficients have
// equal weight.
cv::Mat1d scales(const cv::Mat1d& information) {
  cv::Mat1d scale(information.rows, 1);
  for (int i = 0; i < information.rows; ++i)
    scale(i) = information(i, i) > 0 ? 1 / std::sqrt(information(i, i)) : 1;
  return scale;
}

// Holds the poses of views without a used corner: their block is set to 1.
void hold_unseen(cv::Mat1d& information) {
  for (int i = 0; i < information.rows; ++i)
    if (information(i, i) == 0) information(i, i) = 1;
}

// Runs Levenberg-Marquardt (Nocedal and Wright, "Numerical Optimization", 10.3), damped on the
// diagonal.
Bundle minimised(const Problem& problem, Bundle bundle, const Selection& used) {
  auto residuals = problem.residuals(bundle, used);
  if (!residuals) throw Error("the board's corners lie where no lens can see them");
  double cost = Problem::cost(*residuals, used), damping = 1e-3;
  cv::Mat1d information, gradient, step;
  for (int i = 0; i < most_iterations; ++i) {
    problem.linearise(bundle, used, *residuals, information, gradient);
    hold_unseen(information);
    const cv::Mat1d scale = scales(information);
    const cv::Mat1d scaled = information.mul(scale * scale.t());
    double gain = 0;
    for (; damping < 1e12; damping *= 10) {
      const cv::Mat1d damped = scaled + damping * cv::Mat1d::eye(scaled.size());
      if (!cv::solve(damped, gradient.mul(scale), step, cv::DECOMP_CHOLESKY)) continue;
      const Bundle next = stepped(bundle, step.mul(scale));
      const auto tried = problem.residuals(next, used);
      const double tried_cost = tried ? Problem::cost(*tried, used) : HUGE_VAL;
      if (!(tried_cost <= cost)) continue;
      gain = cost - tried_cost;
      cost = tried_cost;
      bundle = next;
      residuals = tried;
      damping = std::max(damping / 10, 1e-12);
      break;
    }
    if (gain <= 1e-12 * cost) return bundle;
  }
  return bundle;
}

double rms(const std::vector<std::vector<glm::dvec2>>& residuals, const Selection* used) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t v = 0; v < residuals.size(); ++v)
    for (std::size_t i = 0; i < residuals[v].size(); ++i) {
      if (used && !(*used)[v][i]) continue;
      sum += glm::dot(residuals[v][i], residuals[v][i]);
      ++count;
    }
  return count ? std::sqrt(sum / double(count)) : 0;
}

double robust_sigma_px(const std::vector<std::vector<glm::dvec2>>& residuals,
                       const Selection& used) {
  std::vector<double> lengths;
  for (std::size_t v = 0; v < residuals.size(); ++v)
    for (std::size_t i = 0; i < residuals[v].size(); ++i)
      if (used[v][i]) lengths.push_back(glm::length(residuals[v][i]));
  const auto middle = lengths.begin() + std::ptrdiff_t(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle / rayleigh_median;
}

Selection within(const std::vector<std::vector<glm::dvec2>>& residuals, double limit_px) {
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
  cv::Mat1d information, gradient, inverse;
  problem.linearise(fit.bundle, fit.used, fit.residuals, information, gradient);
  hold_unseen(information);
  const cv::Mat1d scale = scales(information);
  if (!cv::invert(information.mul(scale * scale.t()), inverse, cv::DECOMP_CHOLESKY))
    throw Error(
        "the views are too alike to fit a lens: film the board tilted, close, and all over the "
        "picture");
  return inverse.mul(scale * scale.t()) * (fit.sigma_px * fit.sigma_px);
}

}  // namespace

BundleFit fit_bundle(const std::vector<View>& views, Bundle start, const Projection& projection) {
  const Problem problem(views, projection);
  BundleFit fit;
  fit.bundle = std::move(start);
  Selection used = problem.visible(fit.bundle);
  for (int round = 0; round < most_rejections; ++round) {
    fit.bundle = minimised(problem, fit.bundle, used);
    fit.residuals = *problem.residuals(fit.bundle, used);
    const double limit = rejection_sigmas * robust_sigma_px(fit.residuals, used);
    const Selection next = within(fit.residuals, std::max(limit, least_rejection_px));
    if (next == used) break;
    used = next;
  }

  std::size_t views_used = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    const auto count = std::size_t(std::ranges::count(used[v], true));
    fit.corners += used[v].size();
    fit.corners_used += count;
    if (count) ++views_used;
    if (!count) fit.views_left_out.push_back(v);
  }
  const double freedom =
      2.0 * double(fit.corners_used) - double(fit.bundle.lens.size()) - 6.0 * double(views_used);
  if (!(freedom > 0)) throw Error("fewer corners than lens parameters; film more views");
  fit.used = used;
  fit.rms_px = rms(fit.residuals, &used);
  fit.rms_all_px = rms(fit.residuals, nullptr);
  fit.sigma_px = std::sqrt(Problem::cost(fit.residuals, used) / freedom);
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
