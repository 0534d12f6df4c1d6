// The nonlinear least-squares solver of the tracker and of the calibrations: Levenberg-Marquardt
// (Nocedal and Wright, "Numerical Optimization", second edition, 10.3), damped by a share of the
// information's diagonal, so that unknowns of different units have equal weight.
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

namespace previz::tracking {

// The normal equations information * step = gradient of N unknowns; residual = measured - predicted
// and jacobian = the derivative of what is predicted.
template <int N>
struct NormalEquations {
  double cost = 0;  // not finite where the unknowns are outside of the problem's domain
  cv::Matx<double, N, N> information = cv::Matx<double, N, N>::zeros();  // sum of w J^T J
  cv::Matx<double, N, 1> gradient = cv::Matx<double, N, 1>::zeros();     // sum of w J^T r

  // Adds the rows of some residuals, but not their cost.
  template <int Rows>
  void add(const cv::Matx<double, Rows, N>& jacobian, const cv::Matx<double, Rows, 1>& residual,
           double weight = 1) {
    information += weight * (jacobian.t() * jacobian);
    gradient += weight * (jacobian.t() * residual);
  }
};

// Returns the units of the unknowns in which the information's diagonal is 1.
template <typename Matrix>
std::vector<double> units_of(const Matrix& information) {
  std::vector<double> units;
  for (int i = 0; i < information.rows; ++i)
    units.push_back(information(i, i) > 0 ? 1 / std::sqrt(information(i, i)) : 1);
  return units;
}

// Returns the matrix in these units. An unknown that nothing determines, whose row and column are
// 0, gets 1 on the diagonal.
template <typename Matrix>
Matrix in_units(const Matrix& information, const std::vector<double>& units) {
  Matrix scaled(information * 1.0);  // a product, because a copy of a cv::Mat shares its values
  for (int r = 0; r < scaled.rows; ++r) {
    for (int c = 0; c < scaled.cols; ++c)
      scaled(r, c) *= units[std::size_t(r)] * units[std::size_t(c)];
    if (scaled(r, r) == 0) scaled(r, r) = 1;
  }
  return scaled;
}

// Solves (information + damping * its diagonal) * step = gradient by Cholesky's factors, N x N and
// N x 1 of double, cv::Mat1d or cv::Matx. An unknown that nothing determines stays where it is.
// Returns nothing if the matrix is singular.
template <typename Matrix, typename Vector>
std::optional<Vector> damped_step(const Matrix& information, const Vector& gradient,
                                  double damping) {
  const std::vector<double> units = units_of(information);
  Matrix damped = in_units(information, units);
  Vector scaled(gradient * 1.0), step;
  for (int i = 0; i < damped.rows; ++i) {
    damped(i, i) += damping;
    scaled(i) *= units[std::size_t(i)];
  }
  if (!cv::solve(damped, scaled, step, cv::DECOMP_CHOLESKY)) return std::nullopt;
  for (int i = 0; i < damped.rows; ++i) step(i) *= units[std::size_t(i)];
  return step;
}

// Returns the covariance of the unknowns for residuals of unit variance, by Cholesky's factors or,
// with DECOMP_SVD, of what the residuals do determine. An unknown that nothing determines is held:
// its rows are 0. Returns nothing if the information is singular.
template <typename Matrix>
std::optional<Matrix> inverse_of(const Matrix& information, int method = cv::DECOMP_CHOLESKY) {
  const std::vector<double> units = units_of(information);
  Matrix inverse;
  if (cv::invert(in_units(information, units), inverse, method) == 0 &&
      method == cv::DECOMP_CHOLESKY)
    return std::nullopt;
  for (int r = 0; r < inverse.rows; ++r)
    for (int c = 0; c < inverse.cols; ++c)
      inverse(r, c) *= information(r, r) == 0 || information(c, c) == 0
                           ? 0
                           : units[std::size_t(r)] * units[std::size_t(c)];
  return inverse;
}

struct LeastSquaresLimits {
  int most_trials = 100;        // steps that are tried, whether they are taken or not
  double first_damping = 1e-3;  // share of the information's diagonal
  double settled_gain = 1e-12;  // a step that gains no larger share of the cost is the last
};

enum class Stopped {
  settled,  // at a minimum
  trials,   // after the most trials
  stuck,    // no step, however short, lessens the cost
  outside,  // at the start, whose cost is not finite
};

template <typename State, typename Equations>
struct Minimum {
  State at;
  Equations equations;  // what Problem::evaluate() returned for it
  int steps = 0;        // that were taken
  Stopped why = Stopped::outside;
};

// Moves from the start to the nearest minimum. A step is taken if the cost does not grow; the
// damping is then divided by 10, otherwise multiplied by 10. The problem has these functions:
//   evaluate(state) returns its equations, with a member `cost`;
//   moved(state, step) returns the state after a step of NormalEquations; instead of it a problem
//     with equations of its own has stepped(state, equations, damping), which returns nothing if
//     the damped equations are singular;
//   linearise(state, equations), if there is one, completes the equations of a state that was
//     taken, for problems whose derivatives take long;
//   settled(from, to), if there is one, says of a step that was taken that it is the last.
template <typename Problem, typename State>
auto least_squares(const Problem& problem, State start, const LeastSquaresLimits& limits) {
  constexpr double least_damping = 1e-12, most_damping = 1e10;
  Minimum<State, decltype(problem.evaluate(start))> now{start, problem.evaluate(start)};
  if (!std::isfinite(now.equations.cost)) return now;
  now.why = Stopped::trials;
  double damping = limits.first_damping;
  bool linearised = false;
  for (int trial = 0; trial < limits.most_trials; ++trial, damping *= 10) {
    if (damping > most_damping) {
      now.why = Stopped::stuck;
      break;
    }
    if constexpr (requires { problem.linearise(now.at, now.equations); })
      if (!std::exchange(linearised, true)) problem.linearise(now.at, now.equations);
    std::optional<State> next;
    if constexpr (requires { problem.stepped(now.at, now.equations, damping); })
      next = problem.stepped(now.at, now.equations, damping);
    else if (const auto step =
                 damped_step(now.equations.information, now.equations.gradient, damping))
      next = problem.moved(now.at, *step);
    if (!next) continue;
    auto then = problem.evaluate(*next);
    if (!(then.cost <= now.equations.cost)) continue;

    bool settled = now.equations.cost - then.cost <= limits.settled_gain * now.equations.cost;
    if constexpr (requires { problem.settled(now.at, *next); })
      settled = settled || problem.settled(now.at, *next);
    now.at = std::move(*next);
    now.equations = std::move(then);
    ++now.steps;
    linearised = false;
    if (settled) {
      now.why = Stopped::settled;
      break;
    }
    damping = std::max(damping / 10, least_damping) / 10;  // the loop multiplies by 10
  }
  return now;
}

}  // namespace previz::tracking
