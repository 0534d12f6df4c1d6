#include "daemon/core/live/marking.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

namespace previz::live {
namespace {

// Four times what aiming leaves uncertain: one of the marks is of another spot.
constexpr double most_off_px = 4 * session::aimed_px;

}  // namespace

Aim aim_of(const pipeline::Shot& shot, const PinholeIntrinsics& lens) {
  Aim aim{shot.frame->timestamp_ns, {0.5 * (lens.width - 1), 0.5 * (lens.height - 1)}, lens.fx, {}};
  if (shot.track.pose && !shot.track.pose->tags.empty())
    aim.ray = tracking::ray_through(lens, shot.track.pose->world_from_camera, aim.px);
  return aim;
}

tracking::Meeting MarkedCorner::meeting() const {
  std::vector<tracking::Ray> rays;
  for (const Mark& mark : marks) rays.push_back(mark.ray);
  return tracking::meeting_of(rays);
}

std::optional<glm::dvec3> MarkedCorner::place() const {
  const tracking::Meeting met = meeting();
  if (met.parallax_rad < session::least_parallax_rad || met.off_rad > 0.25 * std::numbers::pi)
    return std::nullopt;
  return met.at;
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
  if (order_.empty()) take.clear();
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
  const tracking::Meeting met = corner.meeting();
  if (met.parallax_rad < session::least_parallax_rad)
    return "marked " + times + " from one place; go aside and mark it again";
  if (!corner.place()) return "its marks are of different corners; unmark, and mark one of them";
  const double off_px = corner.marks.front().px_per_rad * std::tan(met.off_rad);
  if (off_px > most_off_px)
    return fmt::format("its marks miss each other by {:.0f} px; unmark, and aim at the same spot",
                       off_px);
  return fmt::format("marked {}, within {:.1f} px", times, off_px);
}

std::string Marking::words_of_box() const {
  if (order_.empty()) return {};
  const Box& box = boxes_[order_.back().first];
  std::array<glm::dvec3, session::corners_of_a_box> places{};
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto place = box[i].place();
    if (!place) return {};
    places[i] = *place;
  }
  const std::string name = fmt::format("box {}", order_.back().first + 1);
  return tracking::fit_a_rectangle(places)
             ? name + " is complete"
             : name + ": its corners are not in order around; unmark, and mark them in order";
}

const MarkedCorner* Marking::last() const {
  if (order_.empty()) return nullptr;
  const auto [box, corner] = order_.back();
  return &boxes_[box][corner];
}

}  // namespace previz::live
