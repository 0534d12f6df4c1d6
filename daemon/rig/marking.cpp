#include "daemon/rig/marking.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>

#include "drivers/calibration/pinhole.hpp"

namespace previz::rig {
namespace {

// A mark is right to about 2 px by aiming (`previzd model` counts it so). Rays that meet at less
// than this angle leave a corner 2 px / (focal length * angle) of its distance uncertain: 4 % at a
// focal length of 600 px.
constexpr double least_parallax_rad = 5 * std::numbers::pi / 180;
// Four times that accuracy: one of the marks is of another spot.
constexpr double most_off_px = 8;

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

}  // namespace

Aim aim_of(const pipeline::Shot& shot, const PinholeIntrinsics& lens) {
  Aim aim{shot.frame->timestamp_ns, {0.5 * (lens.width - 1), 0.5 * (lens.height - 1)}, lens.fx, {}};
  const auto at = undistort(lens, aim.px);
  if (!at || !shot.track.pose || shot.track.pose->tags.empty()) return aim;
  const glm::dmat4& camera = shot.track.pose->world_from_camera;
  aim.ray = {glm::dvec3(camera[3]), glm::normalize(glm::dmat3(camera) * glm::dvec3(*at, 1))};
  return aim;
}

std::optional<MarkedCorner::Place> MarkedCorner::place() const {
  std::vector<tracking::Ray> rays;
  for (const Mark& mark : marks) rays.push_back(mark.ray);
  const tracking::Meeting meeting = tracking::meeting_of(rays);
  if (!(meeting.parallax_rad > 0)) return std::nullopt;
  Place place{meeting.at, meeting.parallax_rad, 0};
  for (const Mark& mark : marks) {
    const double off_rad = angle_between(mark.ray.direction, place.at - mark.ray.origin);
    place.off_px = std::max(place.off_px, mark.px_per_rad * std::tan(off_rad));
  }
  return place;
}

void Marking::begin() {
  const bool was_on = is_on;
  *this = {};
  is_on = was_on;
}

session::MarkEvent Marking::mark(const Aim& aim) {
  boxes_[box_][corner_].marks.push_back({aim.timestamp_ns, *aim.ray, aim.px_per_rad});
  order_.emplace_back(box_, corner_);
  session::MarkEvent event{aim.timestamp_ns, selected(), aim.px};
  next_corner();
  return event;
}

std::optional<session::MarkEvent> Marking::withdraw() {
  if (order_.empty()) return std::nullopt;
  std::tie(box_, corner_) = order_.back();
  order_.pop_back();
  std::vector<MarkedCorner::Mark>& marks = boxes_[box_][corner_].marks;
  const session::MarkEvent event{marks.back().timestamp_ns, selected(), {}, true};
  marks.pop_back();
  return event;
}

void Marking::next_corner() {
  corner_ = (corner_ + 1) % session::corners_of_a_box;
}

void Marking::next_box() {
  corner_ = 0;
  const bool has_marks = std::ranges::any_of(
      boxes_.back(), [](const MarkedCorner& corner) { return !corner.marks.empty(); });
  if (box_ + 1 == boxes_.size() && has_marks) boxes_.emplace_back();
  box_ = (box_ + 1) % boxes_.size();
}

std::string Marking::words_of(const MarkedCorner& corner) {
  const std::size_t count = corner.marks.size();
  if (count == 0) return "not marked";
  if (count == 1) return "marked once";
  const std::string times = count == 2 ? "twice" : fmt::format("{} times", count);
  const auto place = corner.place();
  if (!place || place->parallax_rad < least_parallax_rad)
    return "marked " + times + " from one place; go aside and mark it again";
  if (place->off_px > most_off_px)
    return fmt::format("its marks are {:.0f} px apart; unmark, and aim at the same spot",
                       place->off_px);
  return fmt::format("marked {}, {:.1f} px apart", times, place->off_px);
}

const MarkedCorner* Marking::last() const {
  if (order_.empty()) return nullptr;
  const auto [box, corner] = order_.back();
  return &boxes_[box][corner];
}

}  // namespace previz::rig
