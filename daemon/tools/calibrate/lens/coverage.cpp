#include "daemon/tools/calibrate/lens/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <numbers>

#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr double coverage_degree = std::numbers::pi / 180;
constexpr int least_views = 5;
constexpr int cover_columns = 3, cover_rows = 3;
constexpr double least_tilt_spread = 30 * coverage_degree;
constexpr double near_extent = 1.0 / 3;  // share of the picture's diagonal
constexpr int least_near_views = 2;
constexpr double certain_px = 1;

std::string number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// Calls body(view, corner) for every corner that was used.
template <typename Body>
void for_each_used(const Views& views, const BundleFit& fit, const Body& body) {
  for (std::size_t v = 0; v < views.views.size(); ++v)
    for (std::size_t i = 0; i < views.views[v].pixels.size(); ++i)
      if (fit.used[v][i]) body(v, i);
}

bool left_out(const BundleFit& fit, std::size_t view) {
  return std::ranges::find(fit.views_left_out, view) != fit.views_left_out.end();
}

std::string field_name(int column, int row) {
  constexpr const char* across[] = {"left", "middle", "right"};
  constexpr const char* down[] = {"top", "", "bottom"};
  if (row == 1) return column == 1 ? "middle" : across[column];
  return std::string(down[row]) + " " + across[column];
}

void miss_number(const Views& views, const BundleFit& fit, std::vector<std::string>& missing) {
  const auto used = int(views.views.size() - fit.views_left_out.size());
  if (used < least_views)
    missing.push_back("more views: " + std::to_string(used) + " different ones are usable, " +
                      std::to_string(least_views) + " are needed, 20 recommended");
}

void miss_picture(const Views& views, const BundleFit& fit, std::vector<std::string>& missing) {
  bool seen[cover_rows][cover_columns] = {};
  for_each_used(views, fit, [&](std::size_t v, std::size_t i) {
    const glm::dvec2& p = views.views[v].pixels[i];
    const int column =
        std::clamp(int((p.x + 0.5) * cover_columns / views.width), 0, cover_columns - 1);
    const int row = std::clamp(int((p.y + 0.5) * cover_rows / views.height), 0, cover_rows - 1);
    seen[row][column] = true;
  });
  std::string empty;
  for (int row = 0; row < cover_rows; ++row)
    for (int column = 0; column < cover_columns; ++column)
      if (!seen[row][column]) add_to_list(empty, field_name(column, row));
  if (!empty.empty()) missing.push_back("the board in these areas of the picture: " + empty);
}

void miss_tilt(const BundleFit& fit, std::vector<std::string>& missing) {
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
  for (std::size_t v = 0; v < fit.bundle.poses.size(); ++v) {
    if (left_out(fit, v)) continue;
    glm::dvec3 normal = fit.bundle.poses[v].rotation[2];
    if (normal.z < 0) normal = -normal;
    for (int axis = 0; axis < 2; ++axis) {
      const double tilt = std::atan2(normal[axis], normal.z);
      low[axis] = std::min(low[axis], tilt);
      high[axis] = std::max(high[axis], tilt);
    }
  }
  constexpr const char* how[] = {"turned left and right", "tipped forwards and backwards"};
  for (int axis = 0; axis < 2; ++axis)
    if (const double spread = high[axis] - low[axis]; spread < least_tilt_spread)
      missing.push_back(std::string("the board ") + how[axis] + ": all views lie within " +
                        number("%.0f", spread / coverage_degree) + " degrees, at least " +
                        number("%.0f", least_tilt_spread / coverage_degree) + " are needed");
}

void miss_distance(const Views& views, const BundleFit& fit, std::vector<std::string>& missing) {
  const double diagonal = std::hypot(views.width, views.height);
  int near = 0;
  double largest = 0;
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    if (left_out(fit, v)) continue;
    glm::dvec2 low(HUGE_VAL), high(-HUGE_VAL);
    for (const glm::dvec2& pixel : views.views[v].pixels) {
      low = glm::min(low, pixel);
      high = glm::max(high, pixel);
    }
    const double extent = glm::distance(low, high) / diagonal;
    largest = std::max(largest, extent);
    if (extent >= near_extent) ++near;
  }
  if (near < least_near_views)
    missing.push_back(
        "the board from closer: it must span a third of the picture in at "
        "least " +
        std::to_string(least_near_views) + " views (the largest spans " +
        number("%.0f", 100 * largest) + " %)");
}

void miss_certainty(std::vector<UncertainPixel> picture, std::vector<std::string>& missing) {
  if (picture.empty()) return;
  const auto middle = picture.begin() + std::ptrdiff_t(picture.size() / 2);
  std::ranges::nth_element(picture, middle, {}, &UncertainPixel::sigma_px);
  if (middle->sigma_px > certain_px)
    missing.push_back(
        "more views, or sharper ones of a flatter board: over half the picture the lens "
        "is accurate only to " +
        number("%.1f", middle->sigma_px) + " px");
}

// Says where the picture is least certain and why.
std::string worst_words(const ObserverFit& observer) {
  const auto worst = std::ranges::max_element(observer.picture, {}, &UncertainPixel::sigma_px);
  return number("%.1f", worst->sigma_px) + " px near " + number("%.0f", worst->pixel.x) + ", " +
         number("%.0f", worst->pixel.y) + " (the farthest corner of the board was seen " +
         number("%.0f", 100 * observer.reach) +
         " % of the way from the picture's centre to its corners)";
}

void miss_worst(const ObserverFit& observer, std::vector<std::string>& missing) {
  if (worst_px(observer.picture) > useless_px)
    missing.push_back("the board farther out in the picture: the lens is certain only to " +
                      worst_words(observer));
}

}  // namespace

std::vector<std::string> doubts_of(const ObserverFit& observer) {
  constexpr double least_reach = 2.0 / 3;
  std::vector<std::string> doubts;
  if (worst_px(observer.picture) > doubtful_px)
    doubts.push_back(
        "the lens is certain only to " + worst_words(observer) +
        ": what is placed there will seem to slip; film the board farther out in the picture");
  else if (observer.reach < least_reach)
    doubts.push_back("no corner of the board was seen beyond " +
                     number("%.0f", 100 * observer.reach) +
                     " % of the way from the picture's centre to its corners: farther out the lens "
                     "is a guess, however accurate it seems; film the board there, too");
  return doubts;
}

std::vector<std::string> missing_views(const Views& views, const ObserverFit& observer) {
  std::vector<std::string> missing;
  miss_number(views, observer.fit, missing);
  miss_picture(views, observer.fit, missing);
  miss_tilt(observer.fit, missing);
  miss_distance(views, observer.fit, missing);
  if (missing.empty()) miss_certainty(observer.picture, missing);
  if (missing.empty()) miss_worst(observer, missing);
  return missing;
}

bool has_few_views(const Views& views, const ObserverFit& observer) {
  std::vector<std::string> missing;
  miss_number(views, observer.fit, missing);
  miss_tilt(observer.fit, missing);
  return !missing.empty();
}

std::string why_useless(const ObserverFit& by_few) {
  constexpr double certain_focal_length = 0.1;  // a tenth too near or too far is seen at once
  const BundleFit& fit = by_few.fit;
  const std::size_t used = fit.bundle.poses.size() - fit.views_left_out.size();
  const double f = fit.bundle.lens[0], sigma = lens_sigma(fit)[0];
  if (used > 1 && sigma < certain_focal_length * f) return {};
  return "the focal length is undetermined (" + number("%.0f", f) + " +- " + number("%.0f", sigma) +
         " px, from " + std::to_string(used) + (used == 1 ? " view" : " views") +
         "), even with --force: film the board turned left and right, "
         "and "
         "tipped forwards and backwards";
}

std::vector<std::string> missing_views(const Views& views, const FisheyeFit& fisheye) {
  std::vector<std::string> missing;
  miss_number(views, fisheye.fit, missing);
  std::size_t reached = 0;
  for (const double reach : fisheye.sector_reach_rad)
    if (reach >= least_fisheye_reach_rad) ++reached;
  if (reached < least_fisheye_sectors)
    missing.push_back("the board near the edge of the image circle, all around: corners reach " +
                      number("%.0f", least_fisheye_reach_rad / coverage_degree) +
                      " degrees off axis in " + std::to_string(reached) +
                      " of 8 directions, at least " + std::to_string(least_fisheye_sectors) +
                      " are needed (the widest is at " +
                      number("%.1f", fisheye.widest_corner_rad / coverage_degree) + ")");
  if (missing.empty() && fisheye.uncertain_from_rad < least_fisheye_reach_rad)
    missing.push_back("more or sharper views: beyond " +
                      number("%.0f", fisheye.uncertain_from_rad / coverage_degree) +
                      " degrees off axis the lens is not accurate to 1 px");
  return missing;
}

}  // namespace previz::calibrate
