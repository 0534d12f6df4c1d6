#include "daemon/tools/calibrate/tags/tag_start.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <numeric>
#include <utility>

#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/core/tracking/tag_place.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t pictures_of_a_pair = 12;  // that are looked at, spread over the walk
constexpr std::size_t places_of_a_tag = 12;     // that are tried, likewise
// A single tag's tilt is known to a degree or two; what is beside it is then projected wrong by
// this share of its distance, px.
constexpr double tilt_share = 0.03;
// The losses of the two adjustments, in standard deviations of 1 px: as far as the start may be
// off, and nearer.
constexpr double coarse_px = 20, fine_px = 4;

using CameraPoses = std::vector<tracking::CameraFromWorld>;

glm::dmat4 matrix_of(const tracking::CameraFromWorld& pose) {
  return glm::inverse(tracking::world_from_camera(pose));
}

// The poses of the camera in the frame of a tag, for each sighting: one or two.
std::vector<CameraPoses> poses_of_sightings(const TagWalk& walk, const PinholeIntrinsics& lens) {
  std::vector<CameraPoses> poses;
  for (const TagSighting& seen : walk.sightings) {
    tracking::TagObservation alone;
    alone.size_m = walk.sizes_m[seen.tag];
    alone.corners = seen.corners;
    poses.push_back(tracking::pose_starts({alone}, lens));
  }
  return poses;
}

// What the start is made of.
struct StartData {
  const TagWalk& walk;
  const PinholeIntrinsics& lens;
  std::vector<CameraPoses> alone;                    // of each sighting
  std::vector<std::vector<std::size_t>> by_picture;  // sightings
  std::vector<std::vector<std::size_t>> by_tag;      // sightings, in the walk's order
};

StartData start_data(const TagWalk& walk, const PinholeIntrinsics& lens) {
  StartData data{walk, lens, poses_of_sightings(walk, lens), {}, {}};
  data.by_picture.resize(walk.pictures.size());
  data.by_tag.resize(walk.ids.size());
  for (std::size_t i = 0; i < walk.sightings.size(); ++i) {
    data.by_picture[walk.sightings[i].picture].push_back(i);
    data.by_tag[walk.sightings[i].tag].push_back(i);
  }
  return data;
}

// Returns some of a list, evenly spread over it.
template <typename T>
std::vector<T> some_of(const std::vector<T>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> some;
  for (std::size_t i = 0; i < most; ++i) some.push_back(all[i * all.size() / most]);
  return some;
}

double rms_of(const tracking::CornerPixels& a, const tracking::CornerPixels& b) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += glm::dot(a[i] - b[i], a[i] - b[i]);
  return std::sqrt(sum / 4);
}

// Returns how well a picture agrees with b lying so to a, 0 to 1.
double agreement(const StartData& data, std::size_t a, std::size_t b, const glm::dmat4& a_from_b) {
  const TagSighting &seen_a = data.walk.sightings[a], &seen_b = data.walk.sightings[b];
  const double apart = glm::distance(seen_a.corners[0], seen_b.corners[0]);
  const double scale = 1 + tilt_share * apart;
  const auto nearest = [&](const CameraPoses& cameras, const glm::dmat4& place,
                           const TagSighting& other) {
    double least = HUGE_VAL;
    for (const tracking::CameraFromWorld& camera : cameras)
      least = std::min(least,
                       rms_of(projected_tag(data.lens, camera, place, data.walk.sizes_m[other.tag]),
                              other.corners));
    return least;
  };
  const double off = (nearest(data.alone[a], a_from_b, seen_b) +
                      nearest(data.alone[b], glm::inverse(a_from_b), seen_a)) /
                     scale;
  return 1 / (1 + off * off);
}

// How a pair of tags lies, and how many pictures say so.
struct TagPair {
  std::size_t a = 0, b = 0;  // tags
  glm::dmat4 a_from_b{1.0};
  double support = 0;
};

// `sightings` are those of both tags, a picture each.
TagPair best_pair(const StartData& data,
                  const std::vector<std::pair<std::size_t, std::size_t>>& sightings) {
  TagPair best;
  best.a = data.walk.sightings[sightings.front().first].tag;
  best.b = data.walk.sightings[sightings.front().second].tag;
  const auto some = some_of(sightings, pictures_of_a_pair);
  for (const auto& [a, b] : some)
    for (const tracking::CameraFromWorld& from_a : data.alone[a])
      for (const tracking::CameraFromWorld& from_b : data.alone[b]) {
        const glm::dmat4 a_from_b = tracking::world_from_camera(from_a) * matrix_of(from_b);
        double support = 0;
        for (const auto& [other_a, other_b] : some)
          support += agreement(data, other_a, other_b, a_from_b);
        if (support > best.support) best.support = support, best.a_from_b = a_from_b;
      }
  return best;
}

std::vector<TagPair> all_pairs(const StartData& data) {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<std::pair<std::size_t, std::size_t>>>
      together;
  for (const std::vector<std::size_t>& picture : data.by_picture)
    for (const std::size_t i : picture)
      for (const std::size_t j : picture)
        if (data.walk.sightings[i].tag < data.walk.sightings[j].tag)
          together[{data.walk.sightings[i].tag, data.walk.sightings[j].tag}].emplace_back(i, j);
  std::vector<TagPair> pairs;
  for (const auto& [tags, sightings] : together) pairs.push_back(best_pair(data, sightings));
  return pairs;
}

// Puts each tag that is linked to the origin by the best supported pairs (Prim's algorithm).
// Returns which tags are.
std::vector<bool> place_by_tree(const std::vector<TagPair>& pairs, std::size_t origin,
                                std::vector<glm::dmat4>& world_from_tag) {
  std::vector<bool> placed(world_from_tag.size(), false);
  placed[origin] = true;
  while (true) {
    const TagPair* best = nullptr;
    for (const TagPair& pair : pairs)
      if (placed[pair.a] != placed[pair.b] && (!best || pair.support > best->support)) best = &pair;
    if (!best) return placed;
    if (placed[best->a])
      world_from_tag[best->b] = world_from_tag[best->a] * best->a_from_b;
    else
      world_from_tag[best->a] = world_from_tag[best->b] * glm::inverse(best->a_from_b);
    placed[best->a] = placed[best->b] = true;
  }
}

double robust(double squares_px2, double scale_px) {
  return std::log(1 + squares_px2 / (4 * scale_px * scale_px));
}

double picture_cost(const StartData& data, const std::vector<std::size_t>& picture,
                    const TagPlaces& places, double scale_px) {
  double cost = 0;
  for (const std::size_t i : picture)
    cost += robust(tag_squares_px2(data.walk.sightings[i], data.lens, places), scale_px);
  return cost;
}

// Gives each camera the best of the poses that its picture offers.
void choose_cameras(const StartData& data, const std::vector<bool>& placed, double scale_px,
                    bool from_nothing, TagPlaces& places) {
  for (std::size_t p = 0; p < data.by_picture.size(); ++p) {
    std::vector<tracking::TagObservation> tags;
    std::vector<std::size_t> picture;
    for (const std::size_t i : data.by_picture[p]) {
      const TagSighting& seen = data.walk.sightings[i];
      if (!placed[seen.tag]) continue;
      picture.push_back(i);
      tags.push_back({data.walk.ids[seen.tag],
                      places.sizes_m[seen.tag],
                      places.world_from_tag[seen.tag],
                      seen.corners,
                      {}});
    }
    if (picture.empty()) continue;
    tracking::CameraFromWorld best = places.cameras[p];
    double least = from_nothing ? HUGE_VAL : picture_cost(data, picture, places, scale_px);
    for (const tracking::CameraFromWorld& pose : tracking::pose_starts(tags, data.lens)) {
      places.cameras[p] = pose;
      if (const double cost = picture_cost(data, picture, places, scale_px); cost < least) {
        least = cost;
        best = pose;
      }
    }
    places.cameras[p] = best;
  }
}

double cost_of_tag(const StartData& data, std::size_t tag, const TagPlaces& places,
                   double scale_px) {
  return picture_cost(data, data.by_tag[tag], places, scale_px);
}

// Gives each tag the best of the places that its pictures offer.
void choose_tags(const StartData& data, const std::vector<bool>& placed, std::size_t origin,
                 double scale_px, TagPlaces& places) {
  for (std::size_t t = 0; t < data.by_tag.size(); ++t) {
    if (!placed[t] || t == origin) continue;
    glm::dmat4 best = places.world_from_tag[t];
    double least = cost_of_tag(data, t, places, scale_px);
    for (const std::size_t i : some_of(data.by_tag[t], places_of_a_tag))
      for (const tracking::CameraFromWorld& alone : data.alone[i]) {
        places.world_from_tag[t] =
            tracking::world_from_camera(places.cameras[data.walk.sightings[i].picture]) *
            matrix_of(alone);
        if (const double cost = cost_of_tag(data, t, places, scale_px); cost < least) {
          least = cost;
          best = places.world_from_tag[t];
        }
      }
    places.world_from_tag[t] = best;
  }
}

}  // namespace

std::vector<std::vector<std::size_t>> linked_tags(const TagWalk& walk) {
  std::vector<std::size_t> group(walk.ids.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  std::vector<std::size_t> first_in(walk.pictures.size(), walk.ids.size());
  for (const TagSighting& seen : walk.sightings) {
    std::size_t& first = first_in[seen.picture];
    if (first == walk.ids.size()) first = seen.tag;
    const std::size_t from = group[seen.tag], to = group[first];
    std::ranges::replace(group, from, to);
  }
  std::map<std::size_t, std::vector<std::size_t>> groups;
  for (std::size_t t = 0; t < group.size(); ++t) groups[group[t]].push_back(t);
  std::vector<std::vector<std::size_t>> result;
  for (auto& [name, tags] : groups) result.push_back(std::move(tags));
  std::ranges::stable_sort(result, std::ranges::greater{}, &std::vector<std::size_t>::size);
  return result;
}

TagPlaces start_of_tags(const TagWalk& walk, const PinholeIntrinsics& lens, std::size_t origin) {
  const StartData data = start_data(walk, lens);
  TagPlaces places;
  places.cameras.resize(walk.pictures.size());
  places.world_from_tag.resize(walk.ids.size(), glm::dmat4(1.0));
  places.sizes_m = walk.sizes_m;
  const std::vector<bool> placed = place_by_tree(all_pairs(data), origin, places.world_from_tag);
  choose_cameras(data, placed, coarse_px, true, places);

  TagAdjustment how;
  how.origin = origin;
  how.sizes_free = true;  // a tag that is not as large as stated must not bend the others
  how.model_error_px = 1;
  how.used.resize(walk.sightings.size());
  for (std::size_t i = 0; i < walk.sightings.size(); ++i)
    how.used[i] = placed[walk.sightings[i].tag];
  for (const double scale : {coarse_px, fine_px}) {
    how.loss_scale = scale;
    places = adjust_tags(walk, lens, std::move(places), how);
    choose_tags(data, placed, origin, scale, places);
    choose_cameras(data, placed, scale, false, places);
    places = adjust_tags(walk, lens, std::move(places), how);
  }
  return places;
}

}  // namespace previz::calibrate
