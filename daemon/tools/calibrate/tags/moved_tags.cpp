#include "daemon/tools/calibrate/tags/moved_tags.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "daemon/core/tracking/tag_place.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"

namespace previz::calibrate {
namespace {

constexpr double moved_gain = 60;       // of the cost; noise gains as a chi-square of 6 degrees
constexpr double restless_share = 0.3;  // of sightings that disagree
constexpr std::size_t most_cuts = 24;
constexpr std::size_t least_of_a_place = 2;  // sightings

// The sightings of one tag, whose cameras are known.
struct OneTag {
  const TagWalk& walk;
  const PinholeIntrinsics& lens;
  const TagPlaces& places;
  std::size_t tag;
  double model_error_px;
  std::vector<std::size_t> sightings;                      // in the walk's order
  std::vector<tracking::TagView> views = views_of(*this);  // the same

  static std::vector<tracking::TagView> views_of(const OneTag& one) {
    std::vector<tracking::TagView> views;
    for (const std::size_t s : one.sightings) {
      const TagSighting& seen = one.walk.sightings[s];
      views.push_back({one.places.cameras[seen.picture], seen.corners,
                       seen.variance_px2 + one.model_error_px * one.model_error_px});
    }
    return views;
  }
};

using Range = std::pair<std::size_t, std::size_t>;  // of OneTag::sightings

std::span<const tracking::TagView> views_in(const OneTag& one, const Range& range) {
  return std::span(one.views).subspan(range.first, range.second - range.first);
}

double cost_of(const OneTag& one, const Range& range, const glm::dmat4& place) {
  return tracking::place_cost(one.lens, views_in(one, range), place, one.places.sizes_m[one.tag]);
}

glm::dmat4 fitted_place(const OneTag& one, const Range& range, const glm::dmat4& place) {
  return tracking::fitted_place(one.lens, views_in(one, range), place, one.places.sizes_m[one.tag]);
}

tracking::CornerPixels off(const OneTag& one, std::size_t view, const glm::dmat4& place) {
  return tracking::corners_off(one.lens, one.views[view], place, one.places.sizes_m[one.tag]);
}

// A walk that is cut in two: a place before and one after.
struct Cut {
  std::size_t at = 0;  // index into OneTag::sightings of the first one after
  glm::dmat4 before{1.0}, after{1.0};
  double cost = HUGE_VAL;
};

Cut cut_at(const OneTag& one, std::size_t at, const glm::dmat4& place) {
  Cut cut{at, {}, {}};
  const Range first(0, at), second(at, one.sightings.size());
  cut.before = fitted_place(one, first, place);
  cut.after = fitted_place(one, second, place);
  cut.cost = cost_of(one, first, cut.before) + cost_of(one, second, cut.after);
  return cut;
}

// Returns the best cut, first among some that are spread over the walk, then around that.
Cut best_cut(const OneTag& one, const glm::dmat4& place) {
  const std::size_t first = least_of_a_place, last = one.sightings.size() - least_of_a_place;
  const std::size_t stride = std::max<std::size_t>(1, (last - first + most_cuts) / most_cuts);
  Cut best;
  const auto look_at = [&](std::size_t at) {
    if (const Cut cut = cut_at(one, at, place); cut.cost < best.cost) best = cut;
  };
  for (std::size_t at = first; at <= last; at += stride) look_at(at);
  const std::size_t middle = best.at;
  for (std::size_t at = middle > first + stride ? middle - stride + 1 : first;
       at <= std::min(last, middle + stride - 1); ++at)
    if (at != middle) look_at(at);
  return best;
}

// Returns the mean distance, px, that the corners move between two places, over some pictures.
double moved_px(const OneTag& one, const Cut& cut) {
  double sum = 0;
  for (std::size_t i = 0; i < one.sightings.size(); ++i) {
    const auto before = off(one, i, cut.before), after = off(one, i, cut.after);
    double squares = 0;
    for (std::size_t k = 0; k < 4; ++k)
      squares += glm::dot(before[k] - after[k], before[k] - after[k]);
    sum += std::sqrt(squares / 4);
  }
  return sum / double(one.sightings.size());
}

struct Suspect {
  MovedTag moved;
  double gain = 0;
};

Suspect looked_at(const OneTag& one) {
  const glm::dmat4& place = one.places.world_from_tag[one.tag];
  Suspect suspect;
  suspect.moved.id = one.walk.ids[one.tag];
  const std::size_t count = one.sightings.size();
  std::size_t disagree = 0;
  double most_gates = 0, gate_px = 0;  // the gate's mean
  for (std::size_t i = 0; i < count; ++i) {
    const double px = std::sqrt(tracking::squares_of(off(one, i, place)) / 4);
    suspect.moved.off_px = std::max(suspect.moved.off_px, px);
    const double gate = sighting_gate_px(one.walk.sightings[one.sightings[i]], one.model_error_px);
    most_gates = std::max(most_gates, px / gate);
    gate_px += gate / double(count);
    if (px > gate) ++disagree;
  }
  // Two places a gate apart leave one of them at least half a gate off.
  if (count < 2 * least_of_a_place || most_gates < 0.5) return suspect;
  const double whole = cost_of(one, Range(0, count), place);
  const Cut cut = best_cut(one, place);
  const auto& name = [&](std::size_t i) {
    return one.walk.pictures[one.walk.sightings[one.sightings[i]].picture];
  };
  if (whole - cut.cost > moved_gain && moved_px(one, cut) > gate_px && cut.cost < 0.5 * whole) {
    suspect.gain = whole - cut.cost;
    suspect.moved.until = name(cut.at - 1);
    suspect.moved.since = name(cut.at);
    suspect.moved.distance_m = glm::distance(glm::dvec3(cut.before[3]), glm::dvec3(cut.after[3]));
    suspect.moved.angle_rad = tracking::rotation_between(tracking::camera_from_world(cut.before),
                                                         tracking::camera_from_world(cut.after));
  } else if (double(disagree) >= std::max(2.0, restless_share * double(count))) {
    suspect.gain = whole;
  }
  return suspect;
}

}  // namespace

std::optional<MovedTag> most_moved_tag(const TagWalk& walk, const PinholeIntrinsics& lens,
                                       const TagPlaces& places, double model_error_px) {
  std::vector<std::vector<std::size_t>> by_tag(walk.ids.size());
  for (std::size_t i = 0; i < walk.sightings.size(); ++i)
    by_tag[walk.sightings[i].tag].push_back(i);
  Suspect worst;
  for (std::size_t t = 0; t < walk.ids.size(); ++t) {
    if (by_tag[t].empty()) continue;
    const Suspect suspect = looked_at({walk, lens, places, t, model_error_px, by_tag[t]});
    if (suspect.gain > worst.gain) worst = suspect;
  }
  return worst.gain > 0 ? std::optional(worst.moved) : std::nullopt;
}

std::string words_of(const MovedTag& moved) {
  if (moved.until.empty())
    return fmt::format("no position fits its pictures, some are off by {:.1f} px", moved.off_px);
  return fmt::format("moved by {:.1f} mm and {:.1f} degrees between {} and {}",
                     1000 * moved.distance_m, moved.angle_rad / degree, moved.until, moved.since);
}

}  // namespace previz::calibrate
