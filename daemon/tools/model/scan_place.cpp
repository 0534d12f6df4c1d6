#include "daemon/tools/model/scan_place.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>
#include <utility>

#include "daemon/core/tracking/tag_map.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

using Pairs = std::vector<PointPair>;

// Points lie on one line if they are spread beside it by less than this fraction of their extent
// (root mean square).
constexpr double thinnest = 0.02;
// A scan whose points fit best at a size farther from its own has another unit.
constexpr double most_scale = 1.1;
// One way to place a scan is clearly better than another if its deviations are so many times
// smaller.
constexpr double clearly = 3;

double extent_in_world(const Pairs& points) {
  double extent = 0;
  for (const PointPair& a : points)
    for (const PointPair& b : points)
      extent = std::max(extent, glm::distance(a.in_world, b.in_world));
  return extent;
}

// world = scale * turn * scan + shift.
struct Fitted {
  double scale = 1;
  glm::dmat3 turn{1.0};
  glm::dvec3 shift{0};
  bool is_mirrored = false;
  double rms_m = 0;
  std::vector<double> off_m;
};

bool are_tags(const Pairs& points) {
  return !points.empty() && points.front().tag >= 0;
}

enum class Size { fixed, free };
enum class Hand { rotation, either };

// Returns the best fit at the size `scale`, or at any size; by a rotation, or by whichever of
// rotation and reflection is better.
Fitted best_fit(const Pairs& points, Size size, double scale, Hand hand) {
  const auto count = static_cast<double>(points.size());
  glm::dvec3 from(0), to(0);
  for (const PointPair& p : points) from += p.in_scan / count, to += p.in_world / count;
  cv::Matx33d h = cv::Matx33d::zeros();
  double spread_from = 0, spread_to = 0;
  for (const PointPair& p : points) {
    const glm::dvec3 a = p.in_scan - from, b = p.in_world - to;
    h += cv::Vec3d(b.x, b.y, b.z) * cv::Vec3d(a.x, a.y, a.z).t();
    spread_from += glm::dot(a, a);
    spread_to += glm::dot(b, b);
  }
  Fitted fit;
  fit.scale = scale;
  // The ratio of spreads treats both sides alike (Horn 1987, 2.E).
  if (size == Size::free && spread_from > 0) fit.scale = std::sqrt(spread_to / spread_from);
  cv::Matx33d u, vt;
  cv::Vec3d singular;
  cv::SVD::compute(h, singular, u, vt);
  fit.is_mirrored = hand == Hand::either && cv::determinant(u * vt) < 0;
  const double sign = fit.is_mirrored || cv::determinant(u * vt) > 0 ? 1 : -1;
  const cv::Matx33d r = u * cv::Matx33d::diag(cv::Vec3d(1, 1, sign)) * vt;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) fit.turn[column][row] = r(row, column);
  fit.shift = to - fit.scale * (fit.turn * from);
  for (const PointPair& p : points) {
    fit.off_m.push_back(glm::distance(fit.scale * (fit.turn * p.in_scan) + fit.shift, p.in_world));
    fit.rms_m += fit.off_m.back() * fit.off_m.back() / count;
  }
  fit.rms_m = std::sqrt(fit.rms_m);
  return fit;
}

double worst_of(const Fitted& fit) {
  return *std::ranges::max_element(fit.off_m);
}

std::string names_of(const Pairs& points) {
  std::string names;
  for (const PointPair& p : points) names += (names.empty() ? "\"" : ", \"") + p.name + '"';
  return names;
}

void insist_on_spread(const std::string& subject, const Pairs& points) {
  const auto check = [&](const auto& place_of, const char* where) {
    glm::dvec3 middle(0);
    for (const PointPair& p : points) middle += place_of(p) / static_cast<double>(points.size());
    cv::Matx33d moments = cv::Matx33d::zeros();
    for (const PointPair& p : points) {
      const glm::dvec3 off = place_of(p) - middle;
      const cv::Vec3d d(off.x, off.y, off.z);
      moments += d * d.t();
    }
    cv::Mat1d values;
    cv::eigen(cv::Mat(moments), values);
    if (values(1) > thinnest * thinnest * values(0)) return;
    throw Error(fmt::format(
        "{}: its points {} lie on one line {}, so nothing shows how it is turned around that line; "
        "mark a point beside the line",
        subject, names_of(points), where));
  };
  if (are_tags(points)) return;  // a tag alone shows how it is turned
  check([](const PointPair& p) { return p.in_scan; }, "in the scan");
  check([](const PointPair& p) { return p.in_world; }, "in the pictures");
}

// Returns what may be wrong with a scan whose size is wrong by this factor.
std::string advice_on_size(const Pairs& points, double factor) {
  if (!are_tags(points)) return "; check its unit, and that its points are those that are marked";
  if (factor >= most_scale) return "; check its unit, and the sizes of the tags in the set";
  return "; correct its size, or, if a tag was moved after the scan or the measurement, measure "
         "the "
         "set's tags with previz calibrate tags";
}

[[noreturn]] void refuse_size(const std::string& subject, const Pairs& points, double unit_m,
                              const Fitted& free) {
  const double larger = free.scale / unit_m, factor = std::max(larger, 1 / larger);
  std::string advice = advice_on_size(points, factor);
  for (const auto& [name, unit] : names(LengthUnit{}))
    if (factor >= most_scale &&
        std::abs(std::log(free.scale / metres(unit))) < std::log(most_scale))
      advice = fmt::format(": is its unit \"{0}\"? Set unit = \"{0}\"", name);
  throw Error(fmt::format("{}: the scan would have to be {:.4g} times {}{}", subject, factor,
                          larger > 1 ? "larger" : "smaller", advice));
}

// Returns the point without which the others fit best, and how far it is from where they put it.
std::pair<std::string, double> culprit_of(const Pairs& points, const Fitted& all, double unit_m) {
  std::size_t worst =
      static_cast<std::size_t>(std::ranges::max_element(all.off_m) - all.off_m.begin());
  double off_m = all.off_m[worst], least = all.rms_m;
  for (std::size_t i = 0; points.size() > 3 && i < points.size(); ++i) {
    Pairs others = points;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Fitted fit = best_fit(others, Size::fixed, unit_m, Hand::rotation);
    if (fit.rms_m >= least) continue;
    least = fit.rms_m;
    worst = i;
    off_m =
        glm::distance(fit.scale * (fit.turn * points[i].in_scan) + fit.shift, points[i].in_world);
  }
  return {points[worst].name, off_m};
}

std::vector<int> tags_of(const Pairs& points) {
  std::vector<int> tags;
  for (const PointPair& p : points)
    if (std::ranges::find(tags, p.tag) == tags.end()) tags.push_back(p.tag);
  return tags;
}

// A tag without which the others fit.
struct MovedTag {
  int id = 0;
  double off_m = 0;         // from where the others put it
  double others_rms_m = 0;  // of the others' distances
};

std::vector<MovedTag> moved_tags(const Pairs& points, double unit_m, double most_off_m) {
  std::vector<MovedTag> moved;
  for (const int tag : tags_of(points)) {
    Pairs others = points;
    std::erase_if(others, [&](const PointPair& p) { return p.tag == tag; });
    if (others.empty()) continue;
    const Fitted fit = best_fit(others, Size::fixed, unit_m, Hand::rotation);
    if (worst_of(fit) > most_off_m) continue;
    double off_m = 0;
    for (const PointPair& p : points)
      if (p.tag == tag)
        off_m = std::max(off_m,
                         glm::distance(fit.scale * (fit.turn * p.in_scan) + fit.shift, p.in_world));
    moved.push_back({tag, off_m, fit.rms_m});
  }
  return moved;
}

[[noreturn]] void refuse_tags(const std::string& subject, const Pairs& points,
                              const std::vector<MovedTag>& moved) {
  const std::string advice =
      "; if one was moved after the scan or the measurement, measure the set's tags with previz "
      "calibrate tags, or place the scan by points";
  if (moved.size() == 1)
    throw Error(fmt::format("{}: {} is {:.1f} mm from where the other tags put it{}", subject,
                            tracking::tags_in_words({moved[0].id}), 1000 * moved[0].off_m, advice));
  throw Error(fmt::format("{}: {} are not where the set has them relative to each other{}", subject,
                          tracking::tags_in_words(tags_of(points)), advice));
}

[[noreturn]] void refuse_points(const std::string& subject, const Pairs& points, double unit_m,
                                const Fitted& fit) {
  const auto [name, off_m] = culprit_of(points, fit, unit_m);
  throw Error(fmt::format(
      "{}: point \"{}\" is {:.1f} mm from where the other points put it, more than {:g} % of "
      "their extent of {:.1f} mm; check its coordinates in the scan, its marks, and that both "
      "mean the same spot",
      subject, name, 1000 * off_m, 100 * most_off_fraction, 1000 * extent_in_world(points)));
}

// Corners of tags are measured, so that their extent does not matter: two tags far apart show a
// small error.
double most_off_of(const Pairs& points, double grain_m) {
  const double by_extent = most_off_fraction * extent_in_world(points);
  if (!are_tags(points)) return by_extent;
  const double side_m = glm::distance(points[0].in_world, points[1].in_world);
  return std::min(by_extent, std::max(most_off_side * side_m, 2 * grain_m));
}

}  // namespace

double metres(LengthUnit unit) {
  switch (unit) {
    case LengthUnit::cm:
      return 1e-2;
    case LengthUnit::mm:
      return 1e-3;
    case LengthUnit::in:
      return 0.0254;
    case LengthUnit::m:
      break;
  }
  return 1;
}

Placement place_scan(const std::string& subject, const std::vector<PointPair>& points,
                     double unit_m, double grain_m) {
  const double most_off_m = most_off_of(points, grain_m);
  insist_on_spread(subject, points);
  const Fitted fit = best_fit(points, Size::fixed, unit_m, Hand::rotation);
  const Fitted either = best_fit(points, Size::fixed, unit_m, Hand::either);
  const Fitted free = best_fit(points, Size::free, 1, Hand::either);
  const std::vector<MovedTag> moved = are_tags(points) && worst_of(fit) > most_off_m
                                          ? moved_tags(points, unit_m, most_off_m)
                                          : std::vector<MovedTag>{};
  const bool is_one_off = moved.size() == 1 && moved[0].others_rms_m < free.rms_m;
  if (worst_of(either) > most_off_m && worst_of(free) <= most_off_m && !is_one_off &&
      (are_tags(points) || std::abs(std::log(free.scale / unit_m)) >= std::log(most_scale)))
    refuse_size(subject, points, unit_m, free);
  if (either.is_mirrored && clearly * either.rms_m < fit.rms_m &&
      fit.rms_m > 0.005 * extent_in_world(points))
    throw Error(fmt::format(
        "{}: its {} fit to {:.1f} mm if the scan is mirrored, but to {:.1f} mm as "
        "it is; export it with right-handed axes, without mirroring any of them",
        subject, are_tags(points) ? "tags" : "points", 1000 * either.rms_m, 1000 * fit.rms_m));
  if (worst_of(fit) > most_off_m) {
    if (are_tags(points)) refuse_tags(subject, points, moved);
    refuse_points(subject, points, unit_m, fit);
  }
  return {fit.turn, fit.shift, fit.rms_m,
          best_fit(points, Size::free, 1, Hand::rotation).scale / unit_m};
}

LengthUnit likely_unit(const std::vector<PointPair>& points) {
  const double scale = best_fit(points, Size::free, 1, Hand::either).scale;
  LengthUnit likely = LengthUnit::m;
  for (const auto& [name, unit] : names(LengthUnit{}))
    if (std::abs(std::log(scale / metres(unit))) < std::abs(std::log(scale / metres(likely))))
      likely = unit;
  return likely;
}

UpAxis likely_up(const std::vector<PointPair>& points) {
  const glm::dmat3 turn = best_fit(points, Size::free, 1, Hand::rotation).turn;
  UpAxis likely = UpAxis::x;
  double most = turn[0].z;
  for (const auto& [axis, z] : {std::pair(UpAxis::y, turn[1].z), std::pair(UpAxis::z, turn[2].z)})
    if (z > most) likely = axis, most = z;
  return likely;
}

}  // namespace previz::model
