#include "daemon/core/lighting/source_tracker.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/core/lighting/sources.hpp"

namespace previz::lighting {
namespace {

// A source farther away than this many radii is another source.
constexpr double reach_radii = 4;
// A change by more than this is a lamp that moved or changed its shape, not noise.
constexpr double tremble_radii = 0.25;
constexpr double tremble_ratio = 1.25;

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

struct Pair {
  double angle;
  Source *known, *found;
};

// Moves `found` back so that it goes only a share of the way from the known values to the found
// ones; changes that exceed noise are kept whole.
void smooth(const Source& known, Source& found, double share) {
  if (angle_between(known.direction, found.direction) < tremble_radii * angular_radius(known))
    found.direction = glm::normalize(glm::mix(known.direction, found.direction, share));
  const double ratio = found.solid_angle_sr / known.solid_angle_sr;
  if (std::max(ratio, 1 / ratio) < tremble_ratio)
    found.solid_angle_sr = known.solid_angle_sr * std::pow(ratio, share);
}

}  // namespace

void SourceTracker::follow(std::vector<Source>& sources, std::int64_t timestamp_ns) {
  assert(known_.empty() || timestamp_ns >= last_ns_);
  const double seconds = 1e-9 * static_cast<double>(timestamp_ns - last_ns_);
  const double share = time_constant_s_ > 0 ? -std::expm1(-seconds / time_constant_s_) : 1;
  std::vector<Pair> pairs;
  for (Source& known : known_)
    for (Source& found : sources) {
      const double angle = angle_between(known.direction, found.direction);
      if (angle < reach_radii * std::max(angular_radius(known), angular_radius(found)))
        pairs.push_back({angle, &known, &found});
    }
  std::ranges::stable_sort(pairs, {}, &Pair::angle);
  for (Source& source : sources) source.id = 0;
  for (const Pair& pair : pairs) {
    if (pair.known->id == 0 || pair.found->id != 0) continue;
    smooth(*pair.known, *pair.found, share);
    pair.found->id = pair.known->id;
    pair.known->id = 0;  // taken
  }
  for (Source& source : sources)
    if (source.id == 0) source.id = ++last_id_;
  known_ = sources;
  last_ns_ = timestamp_ns;
}

}  // namespace previz::lighting
