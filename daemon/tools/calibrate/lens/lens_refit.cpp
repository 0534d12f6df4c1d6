#include "daemon/tools/calibrate/lens/lens_refit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "daemon/core/tracking/least_squares.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr int fitted_side = 49, judged_side = 257;
constexpr int most_steps = 20;

struct Ray {
  glm::dvec2 pixel;
  glm::dvec3 direction;
};

using Directions = std::function<glm::dvec3(const glm::dvec2&)>;
using Pixels = std::function<std::optional<glm::dvec2>(const glm::dvec3&)>;

std::vector<Ray> rays_of(int width, int height, int side, const Directions& direction_of) {
  std::vector<Ray> rays;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const glm::dvec2 pixel(double(width - 1) * i / (side - 1),
                             double(height - 1) * j / (side - 1));
      rays.push_back({pixel, direction_of(pixel)});
    }
  return rays;
}

template <typename Intrinsics>
void judge(Refit<Intrinsics>& refit, const Directions& direction_of, const Pixels& pixel_of) {
  for (const Ray& ray : rays_of(refit.lens.width, refit.lens.height, judged_side, direction_of)) {
    const auto pixel = pixel_of(ray.direction);
    const double off =
        pixel ? glm::distance(*pixel, ray.pixel) : std::numeric_limits<double>::infinity();
    if (off <= refit.worst_px) continue;
    refit.worst_px = off;
    refit.worst_pixel = ray.pixel;
  }
}

[[noreturn]] void refuse(const glm::dvec2& pixel, const char* why) {
  throw Error(
      fmt::format("as observer: pixel {:.0f}, {:.0f} {}; use --as light", pixel.x, pixel.y, why));
}

glm::dvec3 forward_direction(const Fisheye& lens, const glm::dvec2& pixel) {
  const auto direction = lens.unproject(pixel);
  if (!direction) refuse(pixel, "is outside of the fisheye's circle");
  if (!(direction->z > 1e-3))
    refuse(pixel, "is 90 degrees or more off axis, which the film camera's lens cannot hold");
  return *direction;
}

// The row of one ray in n(s) - q d(s) = 0, where s is the square of the tangent of the angle off
// axis, in units of its largest, and q the radius that the fisheye draws over that tangent.
struct RadialRow {
  double s, q, weight;
};

std::vector<RadialRow> radial_rows(const FisheyeIntrinsics& lens, const std::vector<Ray>& rays,
                                   double& largest) {
  std::vector<RadialRow> rows;
  largest = 0;
  for (const Ray& ray : rays) {
    const double tangent = std::hypot(ray.direction.x, ray.direction.y) / ray.direction.z;
    if (tangent < 1e-9) continue;
    const double drawn =
        std::hypot((ray.pixel.x - lens.cx) / lens.fx, (ray.pixel.y - lens.cy) / lens.fy);
    rows.push_back({tangent * tangent, drawn / tangent, tangent});
    largest = std::max(largest, tangent * tangent);
  }
  for (RadialRow& row : rows) row.s /= largest;
  return rows;
}

double divisor_at(const std::array<double, 6>& k, double s) {
  return 1 + s * (k[3] + s * (k[4] + s * k[5]));
}

// Solves the rows for k1..k6 (in units of `s`), with the divisor of the last solution as weight.
std::array<double, 6> solve_radial(const std::vector<RadialRow>& rows,
                                   const std::array<double, 6>& last, int coefficients) {
  cv::Mat1d a(int(rows.size()), coefficients), b(int(rows.size()), 1), x;
  for (int i = 0; i < a.rows; ++i) {
    const auto& [s, q, tangent] = rows[std::size_t(i)];
    const double weight = tangent / divisor_at(last, s);
    for (int c = 0; c < coefficients; ++c)
      a(i, c) = weight * std::pow(s, c % 3 + 1) * (c < 3 ? 1 : -q);
    b(i) = weight * (q - 1);
  }
  cv::solve(a, b, x, cv::DECOMP_SVD);
  std::array<double, 6> k{};
  std::copy_n(x.begin(), coefficients, k.begin());
  return k;
}

Refit<PinholeIntrinsics> pinhole_of(const FisheyeIntrinsics& lens, const std::array<double, 6>& k,
                                    double unit, const Directions& direction_of) {
  Refit<PinholeIntrinsics> refit;
  refit.lens = {lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy};
  refit.lens.k1 = k[0] / unit;
  refit.lens.k2 = k[1] / (unit * unit);
  refit.lens.k3 = k[2] / (unit * unit * unit);
  refit.lens.k4 = k[3] / unit;
  refit.lens.k5 = k[4] / (unit * unit);
  refit.lens.k6 = k[5] / (unit * unit * unit);
  judge(refit, direction_of, [&](const glm::dvec3& d) -> std::optional<glm::dvec2> {
    const glm::dvec2 normalised(d.x / d.z, d.y / d.z);
    const glm::dvec2 pixel = distort(refit.lens, normalised);
    return is_unfolded(refit.lens, normalised, pixel) ? std::optional(pixel) : std::nullopt;
  });
  return refit;
}

glm::dvec3 pinhole_direction(const PinholeIntrinsics& lens, const glm::dvec2& pixel) {
  const auto normalised = undistort(lens, pixel);
  if (!normalised)
    throw Error(fmt::format("as light: the lens folds at pixel {:.0f}, {:.0f}; calibrate again",
                            pixel.x, pixel.y));
  return glm::normalize(glm::dvec3(*normalised, 1));
}

struct FisheyeProblem {
  using Equations = tracking::NormalEquations<8>;  // fx, fy, cx, cy, k1..k4
  const std::vector<Ray>& rays;

  Equations evaluate(const FisheyeIntrinsics& lens) const {
    Equations sum;
    for (const auto& [pixel, direction] : rays) {
      const double off_z = std::hypot(direction.x, direction.y);
      const double angle = std::atan2(off_z, direction.z);
      const glm::dvec2 around =
          off_z > 0 ? glm::dvec2(direction.x, direction.y) / off_z : glm::dvec2(0);
      const glm::dvec2 drawn = fisheye_pixel(lens, direction), off = pixel - drawn;
      cv::Matx<double, 2, 8> jacobian = cv::Matx<double, 2, 8>::zeros();
      for (int axis = 0; axis < 2; ++axis) {
        const double focal = axis ? lens.fy : lens.fx, centre = axis ? lens.cy : lens.cx;
        jacobian(axis, axis) = (drawn[axis] - centre) / focal;
        jacobian(axis, 2 + axis) = 1;
        for (int c = 0; c < 4; ++c)
          jacobian(axis, 4 + c) = focal * around[axis] * std::pow(angle, 2 * c + 3);
      }
      sum.add(jacobian, cv::Matx21d(off.x, off.y));
      sum.cost += glm::dot(off, off);
    }
    return sum;
  }

  static FisheyeIntrinsics moved(FisheyeIntrinsics lens, const cv::Matx<double, 8, 1>& step) {
    lens.fx += step(0);
    lens.fy += step(1);
    lens.cx += step(2);
    lens.cy += step(3);
    for (int c = 0; c < 4; ++c) lens.k[std::size_t(c)] += step(4 + c);
    return lens;
  }
};

double farthest_corner_rad(const PinholeIntrinsics& lens) {
  double angle = 0;
  for (const double x : {0.0, lens.width - 1.0})
    for (const double y : {0.0, lens.height - 1.0}) {
      const glm::dvec3 d = pinhole_direction(lens, {x, y});
      angle = std::max(angle, std::atan2(std::hypot(d.x, d.y), d.z));
    }
  return angle;
}

}  // namespace

Refit<PinholeIntrinsics> refit_as_pinhole(const FisheyeIntrinsics& intrinsics) {
  const Fisheye lens(intrinsics);
  const Directions direction_of = [&](const glm::dvec2& pixel) {
    return forward_direction(lens, pixel);
  };
  double unit = 1;
  const auto rows = radial_rows(
      intrinsics, rays_of(intrinsics.width, intrinsics.height, fitted_side, direction_of), unit);
  Refit<PinholeIntrinsics> best =
      pinhole_of(intrinsics, solve_radial(rows, {}, 3), unit, direction_of);
  std::array<double, 6> k{};
  for (int i = 0; i < most_steps; ++i) k = solve_radial(rows, k, 6);
  const Refit<PinholeIntrinsics> rational = pinhole_of(intrinsics, k, unit, direction_of);
  return rational.worst_px < best.worst_px ? rational : best;
}

Refit<FisheyeIntrinsics> refit_as_fisheye(const PinholeIntrinsics& lens) {
  const Directions direction_of = [&](const glm::dvec2& pixel) {
    return pinhole_direction(lens, pixel);
  };
  const auto rays = rays_of(lens.width, lens.height, fitted_side, direction_of);
  Refit<FisheyeIntrinsics> refit;
  refit.lens = {lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy};
  refit.lens = tracking::least_squares(FisheyeProblem{rays}, refit.lens, {}).at;
  const double corner = farthest_corner_rad(lens);
  const double fold = monotonic_limit_rad(refit.lens.k);
  refit.lens.max_angle_rad = std::min(corner + 1e-6, fold * (1 - 1e-9));
  if (!(refit.lens.fx > 0 && refit.lens.fy > 0))
    throw Error("as light: no fisheye fits this lens; use --as observer");
  const Fisheye fisheye(refit.lens);
  judge(refit, direction_of, [&](const glm::dvec3& d) { return fisheye.project(d); });
  return refit;
}

}  // namespace previz::calibrate
