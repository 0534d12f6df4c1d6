#include "daemon/core/tracking/tag_place.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/least_squares.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

constexpr double kPlaceLoss = 3;  // standard deviations, as of the map's adjustment
constexpr double kLossScale = 8 * kPlaceLoss * kPlaceLoss;
constexpr std::size_t kMostStarts = 3;  // views that give one
// A simpler explanation is as good as a place of its own if it leaves no more than this.
constexpr double kAsGood = 2, kAsGoodPx = 0.1;
constexpr double kSameTurnRad = 0.2, kSamePlace = 0.25;  // of exchanged tags; share of the size
constexpr double kWorthMm = 1, kWorthDegrees = 0.5;

using EightRows = cv::Matx<double, 8, 1>;

EightRows rows_of(const CornerPixels& off) {
  EightRows rows;
  for (int i = 0; i < 8; ++i) rows(i) = off[std::size_t(i / 2)][i % 2];
  return rows;
}

// Some of the views, with weights of the robust loss and derivatives by central differences.
struct PlaceProblem {
  const PinholeIntrinsics& lens;
  std::span<const TagView> views;
  double size_m;

  NormalEquations<6> evaluate(const glm::dmat4& place) const {
    constexpr double small = 1e-6;
    NormalEquations<6> sum;
    sum.cost = place_cost(lens, views, place, size_m);
    for (std::size_t i = 0; i < views.size() && std::isfinite(sum.cost); ++i) {
      const TagView& view = views[i];
      cv::Matx<double, 8, 6> by;
      for (int c = 0; c < 6; ++c) {
        cv::Vec6d motion = cv::Vec6d::all(0);
        motion[c] = small;
        const EightRows slope = (rows_of(corners_off(lens, view, moved(place, -motion), size_m)) -
                                 rows_of(corners_off(lens, view, moved(place, motion), size_m))) *
                                (1 / (2 * small));
        for (int k = 0; k < 8; ++k) by(k, c) = slope(k);
      }
      const EightRows r = rows_of(corners_off(lens, view, place, size_m));
      sum.add(by, r, 1 / (view.variance_px2 * (1 + r.dot(r) / view.variance_px2 / kLossScale)));
    }
    return sum;
  }

  // Moves a place by a rotation and a shift along the tag's own axes.
  static glm::dmat4 moved(const glm::dmat4& place, const cv::Matx61d& by) {
    glm::dmat4 motion(rotation_by({by(0), by(1), by(2)}));
    motion[3] = glm::dvec4(by(3), by(4), by(5), 1);
    return place * motion;
  }
};

double rms_of(const PinholeIntrinsics& lens, std::span<const TagView> views,
              const glm::dmat4& place, double size_m) {
  double squares = 0;
  for (const TagView& view : views)
    squares += squares_of(corners_off(lens, view, place, size_m)) / 4;
  return std::sqrt(squares / double(views.size()));
}

// Finds the place that fits best, wherever it is.
glm::dmat4 place_of(const set::Tag& tag, const PinholeIntrinsics& lens,
                    std::span<const TagView> views) {
  glm::dmat4 best = fitted_place(lens, views, tag.world_from_tag, tag.size_m);
  double least = place_cost(lens, views, best, tag.size_m);
  for (const TagView& view : views.first(std::min(kMostStarts, views.size()))) {
    TagObservation alone{tag.id, tag.size_m, glm::dmat4(1), view.corners, {}};
    for (std::size_t i = 0; i < 8; ++i) alone.covariance[9 * i] = view.variance_px2;
    for (const FittedPose& pose : solve_joint_pose({alone}, lens, {})) {
      const glm::dmat4 start =
          world_from_camera(view.camera) * glm::inverse(world_from_camera(pose.pose));
      const glm::dmat4 place = fitted_place(lens, views, start, tag.size_m);
      const double cost = place_cost(lens, views, place, tag.size_m);
      if (!(cost < least)) continue;
      least = cost;
      best = place;
    }
  }
  return best;
}

// Finds the factor of the tag's size that fits best where the set has it.
double size_factor(const set::Tag& tag, const PinholeIntrinsics& lens,
                   std::span<const TagView> views) {
  double best = 0;
  const auto cost = [&](double exponent) {
    return place_cost(lens, views, tag.world_from_tag, std::exp(exponent) * tag.size_m);
  };
  for (double by = 0.4; by > 1e-5; by /= 2)
    for (const double tried : {best - by, best + by})
      if (cost(tried) < cost(best)) best = tried;
  return std::exp(best);
}

double turn_between(const glm::dmat4& a, const glm::dmat4& b) {
  return rotation_between(camera_from_world(a), camera_from_world(b));
}

std::string moved_words(const glm::dmat4& from, const glm::dmat4& to) {
  const glm::dvec3 mm = 1000.0 * glm::dvec3(to[3] - from[3]);
  const double degrees = turn_between(from, to) * 180 / std::numbers::pi;
  std::string text;
  if (glm::length(mm) > kWorthMm)
    text = fmt::format("is {:.1f} mm off (x {:+.1f}, y {:+.1f}, z {:+.1f} mm)", glm::length(mm),
                       mm.x, mm.y, mm.z);
  if (degrees > kWorthDegrees)
    text += fmt::format("{}turned by {:.1f} degrees", text.empty() ? "is " : " and ", degrees);
  return text;
}

}  // namespace

CornerPixels projected_tag(const PinholeIntrinsics& lens, const CameraFromWorld& camera,
                           const glm::dmat4& world_from_tag, double size_m) {
  CornerPixels pixels;
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const glm::dvec3 world(world_from_tag * glm::dvec4(tag_corner(size_m, corner), 1));
    const glm::dvec3 x = camera.rotation * world + camera.translation;
    pixels[corner] = x.z > 1e-6 ? distort(lens, {x.x / x.z, x.y / x.z}) : glm::dvec2(HUGE_VAL);
  }
  return pixels;
}

CornerPixels corners_off(const PinholeIntrinsics& lens, const TagView& view,
                         const glm::dmat4& world_from_tag, double size_m) {
  CornerPixels off = projected_tag(lens, view.camera, world_from_tag, size_m);
  for (std::size_t i = 0; i < 4; ++i) off[i] = view.corners[i] - off[i];
  return off;
}

double squares_of(const CornerPixels& off) {
  double squares = 0;
  for (const glm::dvec2& d : off) squares += glm::dot(d, d);
  return squares;
}

double place_cost(const PinholeIntrinsics& lens, std::span<const TagView> views,
                  const glm::dmat4& world_from_tag, double size_m) {
  double sum = 0;
  for (const TagView& view : views) {
    const double squares =
        squares_of(corners_off(lens, view, world_from_tag, size_m)) / view.variance_px2;
    sum += std::isfinite(squares) ? kLossScale * std::log(1 + squares / kLossScale) : HUGE_VAL;
  }
  return sum;
}

glm::dmat4 fitted_place(const PinholeIntrinsics& lens, std::span<const TagView> views,
                        const glm::dmat4& start, double size_m) {
  const LeastSquaresLimits limits{.most_trials = 12, .settled_gain = 1e-6};
  return least_squares(PlaceProblem{lens, views, size_m}, start, limits).at;
}

TagView view_of(const TagObservation& tag, const glm::dmat4& world_from_camera) {
  double variance = kCornerFloorPx * kCornerFloorPx;
  for (std::size_t i = 0; i < 8; ++i) variance += tag.covariance[9 * i] / 8;
  return {camera_from_world(world_from_camera), tag.corners, variance};
}

double chi_square_of(const PinholeIntrinsics& lens, const TagObservation& tag, const Pose& pose) {
  const auto off_after = [&](int axis, double amount) {
    std::array<double, 6> by{};
    by[std::size_t(axis)] = amount;
    glm::dmat4 motion(rotation_by({by[0], by[1], by[2]}));
    motion[3] = glm::dvec4(by[3], by[4], by[5], 1);
    return rows_of(corners_off(lens, view_of(tag, pose.world_from_camera * motion),
                               tag.world_from_tag, tag.size_m));
  };
  constexpr double small = 1e-6;
  cv::Matx<double, 8, 6> by_motion;
  for (int axis = 0; axis < 6; ++axis) {
    const EightRows slope = (off_after(axis, small) - off_after(axis, -small)) * (0.5 / small);
    for (int k = 0; k < 8; ++k) by_motion(k, axis) = slope(k);
  }
  cv::Matx<double, 8, 8> spread(tag.covariance.data());
  for (int i = 0; i < 8; ++i) spread(i, i) += kCornerFloorPx * kCornerFloorPx;
  spread += by_motion * cv::Matx<double, 6, 6>(pose.covariance.data()) * by_motion.t();
  const EightRows off = off_after(0, 0);
  return off.dot(spread.solve(off, cv::DECOMP_SVD));
}

std::string why_elsewhere(const set::Tag& tag, const std::vector<set::Tag>& tags,
                          const PinholeIntrinsics& lens, std::span<const TagView> views) {
  const glm::dmat4 place = place_of(tag, lens, views);
  const double off_px = rms_of(lens, views, place, tag.size_m);
  const auto explains = [&](double rms_px) { return rms_px < kAsGood * off_px + kAsGoodPx; };
  const double factor = size_factor(tag, lens, views);
  if (explains(rms_of(lens, views, tag.world_from_tag, factor * tag.size_m)))
    return fmt::format(
        "measures {:.2f} mm in place of {:.2f} mm ({:.1f} %): correct its size_m, or print it "
        "again",
        1000 * factor * tag.size_m, 1000 * tag.size_m, 100 * factor);
  if (!(off_px < consistency_gate_px(lens)))
    return fmt::format(
        "has no place that fits its pictures, which are off by {:.1f} px: it has not stayed where "
        "it was, or is not flat",
        off_px);
  constexpr const char* what_to_do =
      ": put it back, or measure where it is (`previz calibrate tags TAKE`)";
  for (const set::Tag& other : tags)
    if (other.id != tag.id && turn_between(other.world_from_tag, place) < kSameTurnRad &&
        glm::distance(glm::dvec3(other.world_from_tag[3]), glm::dvec3(place[3])) <
            kSamePlace * tag.size_m)
      return fmt::format("is where the set has tag {}: exchange the two", other.id);
  const std::string moved = moved_words(tag.world_from_tag, place);
  return (moved.empty() ? "is not where the set has it" : moved) + what_to_do;
}

}  // namespace previz::tracking
