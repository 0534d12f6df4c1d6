#include "daemon/tools/model/start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "daemon/core/tracking/pose_starts.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

constexpr double degree = std::numbers::pi / 180;
// Rays that meet at less show nothing of the distance.
constexpr double least_parallax = 0.5 * degree;
// Planes that lie within this of one direction are parallel.
constexpr double least_angle = 2 * degree;

using Points = std::vector<glm::dvec3>;

glm::dvec3 mean_of(const Points& points) {
  glm::dvec3 sum(0);
  for (const glm::dvec3& p : points) sum += p;
  return sum / static_cast<double>(std::max<std::size_t>(points.size(), 1));
}

// Returns the normal of the plane that fits the points best, and how far they are spread along the
// narrower of the plane's directions (rms, metres).
std::pair<glm::dvec3, double> flattest(const Points& points) {
  const glm::dvec3 middle = mean_of(points);
  cv::Matx33d moments = cv::Matx33d::zeros();
  for (const glm::dvec3& p : points) {
    const cv::Vec3d off(p.x - middle.x, p.y - middle.y, p.z - middle.z);
    moments += off * off.t();
  }
  cv::Mat1d values, vectors;
  cv::eigen(cv::Mat(moments), values, vectors);
  return {{vectors(2, 0), vectors(2, 1), vectors(2, 2)},
          std::sqrt(std::max(values(1), 0.0) / static_cast<double>(points.size()))};
}

std::optional<glm::dvec3> meet(const Ray& ray, const Plane& plane) {
  const double along = glm::dot(ray.direction, plane.normal);
  if (std::abs(along) < 1e-6) return {};
  const double t = glm::dot(plane.at - ray.origin, plane.normal) / along;
  return t > 0 ? std::optional(ray.origin + t * ray.direction) : std::nullopt;
}

class Starter {
 public:
  Starter(const Parts& parts, const Views& views, const std::vector<set::Tag>& tags)
      : parts_(parts), views_(views), tags_(tags) {
    for (const MarkedView& view : views.views)
      for (const Mark& mark : view.marks) rays_[mark.point].push_back(ray_of(views, view, mark));
    for (const MarkedView& view : views.views)
      eyes_.emplace_back(tracking::world_from_camera(view.pose.pose)[3]);
  }

  Start start() {
    shape_.planes.resize(parts_.planes.size());
    for (const PlanePart& part : parts_.planes)
      layout_.plane_on.push_back(
          part.upright_on.empty() ? std::nullopt : std::optional(plane_named(part.upright_on)));
    for (const bool stands : {false, true})  // first those that others stand on
      for (std::size_t i = 0; i < parts_.planes.size(); ++i)
        if (layout_.plane_on[i].has_value() == stands) start_plane(i);
    for (const BoxPart& part : parts_.boxes) start_box(part);
    for (const CylinderPart& part : parts_.cylinders) start_cylinder(part);
    start_points();
    check_rooms();
    shape_.cameras_off.resize(views_.views.size());
    settle(layout_, shape_);
    return {std::move(layout_), std::move(shape_)};
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(parts_.file.string() + ": " + what);
  }

  std::size_t plane_named(const std::string& name) const {
    const auto found = std::ranges::find(parts_.planes, name, &PlanePart::name);
    return static_cast<std::size_t>(found - parts_.planes.begin());
  }

  const set::Tag& tag(int id, const std::string& part) const {
    const auto found = std::ranges::find(tags_, id, &set::Tag::id);
    if (found == tags_.end())
      refuse(
          fmt::format("tag {} of \"{}\" is not in the set; add its [[tag]] table, which previz "
                      "calibrate tags writes, or remove it here",
                      id, part));
    return *found;
  }

  // Returns where a point is, by its rays; nothing if it has one, or if they show no distance.
  std::optional<glm::dvec3> place_of(const std::string& point) const {
    const auto found = rays_.find(point);
    if (point.empty() || found == rays_.end() || found->second.size() < 2) return {};
    const tracking::Meeting met = tracking::meeting_of(found->second);
    return met.parallax_rad > least_parallax ? std::optional(met.at) : std::nullopt;
  }

  glm::dvec3 needed_place_of(const std::string& point) const {
    if (const auto place = place_of(point)) return *place;
    refuse(fmt::format(
        "point \"{}\": the pictures that show it are taken from less than {:.1f} degrees "
        "apart, so its distance is unknown; mark it in a picture from further aside",
        point, least_parallax / degree));
  }

  glm::dvec3 foot_of(const std::string& point, std::size_t plane) const {
    if (const auto place = place_of(point)) return *place;
    const auto met = meet(rays_.at(point).front(), shape_.planes[plane]);
    return met ? *met : needed_place_of(point);
  }

  // What is below the corners of a tag.
  static Points below_corners_of(const set::Tag& tag, double thickness_m) {
    Points below;
    for (const glm::dvec3& corner : corners_of(tag))
      below.push_back(corner - thickness_m * glm::dvec3(tag.world_from_tag[2]));
    return below;
  }

  void start_plane(std::size_t index) {
    const PlanePart& part = parts_.planes[index];
    Points on_it;
    glm::dvec3 face(0);
    for (const int id : part.tags) {
      const set::Tag& flat = tag(id, part.name);
      layout_.tags.push_back({&flat, part.tag_thickness_m, index});
      for (const glm::dvec3& p : below_corners_of(flat, part.tag_thickness_m)) on_it.push_back(p);
      face += glm::dvec3(flat.world_from_tag[2]);
    }
    for (const auto* names : {&part.points, &part.outline})
      for (const std::string& point : *names)
        if (part.tags.empty() || place_of(point)) on_it.push_back(needed_place_of(point));
    for (const std::string& point : part.foot)
      on_it.push_back(foot_of(point, *layout_.plane_on[index]));
    Plane& plane = shape_.planes[index];
    plane.at = mean_of(on_it);
    plane.normal = normal_of(part, layout_.plane_on[index], on_it);
    if (face == glm::dvec3(0)) face = mean_of(eyes_) - plane.at;
    if (glm::dot(plane.normal, face) < 0) plane.normal = -plane.normal;
  }

  glm::dvec3 normal_of(const PlanePart& part, std::optional<std::size_t> on,
                       const Points& on_it) const {
    if (!on) {
      const auto [normal, spread] = flattest(on_it);
      if (spread < 1e-3)
        refuse(fmt::format(
            "the points of plane \"{}\" lie on one line, so that it may turn about it; mark a "
            "point beside that line",
            part.name));
      return normal;
    }
    const Plane& below = shape_.planes[*on];
    Points flat;
    for (const glm::dvec3& p : on_it)
      flat.push_back(p - glm::dot(p - below.at, below.normal) * below.normal);
    // The direction in which they are spread most is along the wall.
    const glm::dvec3 middle = mean_of(flat);
    const auto farthest =
        std::ranges::max(flat, {}, [&](const glm::dvec3& p) { return glm::distance(p, middle); });
    if (glm::distance(farthest, middle) < 1e-3)
      refuse(fmt::format(
          "the points of plane \"{}\" lie above each other, so that it may turn about them; mark "
          "a point beside them",
          part.name));
    return glm::normalize(glm::cross(farthest - middle, below.normal));
  }

  void start_box(const BoxPart& part) {
    layout_.box_on.push_back(part.on.empty() ? std::nullopt : std::optional(plane_named(part.on)));
    layout_.is_clockwise.push_back(false);
    shape_.boxes.emplace_back();
    const std::array<std::optional<glm::dvec3>, 4> above = places_of(part.top),
                                                   below =
                                                       feet_of(part.bottom, layout_.box_on.back());
    std::size_t around = 0;
    for (std::size_t i = 0; i < 4; ++i) around += above[i] || below[i];
    if (around >= 3)
      start_box_by_corners(part, above, below);
    else if (!part.tags.empty())
      start_box_by_tags(part);
    else
      for (const auto* names : {&part.top, &part.bottom})
        for (const std::string& point : *names)
          if (!point.empty()) needed_place_of(point);  // says which is missing
    const std::size_t box = shape_.boxes.size() - 1;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t corner = layout_.is_clockwise[box] ? (4 - i) % 4 : i;
      if (!part.bottom.empty())
        bind(part.bottom[i], {Place::Kind::box_corner, box, corner}, part.name);
      if (!part.top.empty())
        bind(part.top[i], {Place::Kind::box_corner, box, corner + 4}, part.name);
    }
    for (const int id : part.tags) bind_to_side(tag(id, part.name), part.tag_thickness_m, box);
  }

  void bind(const std::string& point, Place place, const std::string& part) {
    if (point.empty()) return;
    if (!layout_.places.emplace(point, place).second)
      refuse(fmt::format(
          "point \"{}\" of \"{}\" is a corner already; give each corner a point of its own", point,
          part));
  }

  std::array<std::optional<glm::dvec3>, 4> places_of(const std::vector<std::string>& names) const {
    std::array<std::optional<glm::dvec3>, 4> places;
    for (std::size_t i = 0; i < names.size(); ++i) places[i] = place_of(names[i]);
    return places;
  }

  // On a plane, one picture of a corner is enough.
  std::array<std::optional<glm::dvec3>, 4> feet_of(const std::vector<std::string>& names,
                                                   std::optional<std::size_t> on) const {
    auto places = places_of(names);
    for (std::size_t i = 0; on && i < names.size(); ++i)
      if (!places[i] && !names[i].empty())
        places[i] = meet(rays_.at(names[i]).front(), shape_.planes[*on]);
    return places;
  }

  // Returns the corners as they are seen from above, on the ground; one that is not marked makes a
  // parallelogram of the others.
  static std::array<glm::dvec3, 4> footprint(const std::array<std::optional<glm::dvec3>, 4>& above,
                                             const std::array<std::optional<glm::dvec3>, 4>& below,
                                             const glm::dvec3& ground, const glm::dvec3& up) {
    std::array<glm::dvec3, 4> feet{};
    std::optional<std::size_t> missing;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& seen = below[i] ? below[i] : above[i];
      if (seen)
        feet[i] = *seen - glm::dot(*seen - ground, up) * up;
      else
        missing = i;
    }
    if (missing) {
      const std::size_t m = *missing;
      feet[m] = feet[(m + 1) % 4] + feet[(m + 3) % 4] - feet[(m + 2) % 4];
    }
    return feet;
  }

  void start_box_by_corners(const BoxPart& part,
                            const std::array<std::optional<glm::dvec3>, 4>& above,
                            const std::array<std::optional<glm::dvec3>, 4>& below) {
    Box& box = shape_.boxes.back();
    const std::optional<std::size_t> on = layout_.box_on.back();
    Points top, bottom;
    for (std::size_t i = 0; i < 4; ++i) {
      if (above[i]) top.push_back(*above[i]);
      if (below[i]) bottom.push_back(*below[i]);
    }
    const glm::dvec3 up = on ? shape_.planes[*on].normal : up_of(part, top, bottom);
    const glm::dvec3 ground = on ? shape_.planes[*on].at : mean_of(bottom.empty() ? top : bottom);
    std::array<glm::dvec3, 4> feet = footprint(above, below, ground, up);
    const bool is_clockwise = glm::dot(glm::cross(feet[2] - feet[0], feet[3] - feet[1]), up) < 0;
    if (is_clockwise) std::swap(feet[1], feet[3]);
    layout_.is_clockwise.back() = is_clockwise;
    const glm::dvec3 along = 0.5 * (feet[1] - feet[0] + feet[2] - feet[3]);
    box.axes = upright_axes(along, up);
    box.size.x = glm::length(along);
    box.size.y = glm::dot(box.axes[1], 0.5 * (feet[3] - feet[0] + feet[2] - feet[1]));
    if (!top.empty()) {
      const double from =
          on || bottom.empty() ? glm::dot(ground, up) : glm::dot(mean_of(bottom), up);
      box.size.z = glm::dot(mean_of(top), up) - from;
    }
    const auto known = known_sizes(part, is_clockwise);
    for (std::size_t k = 0; k < 3; ++k)
      if (known[k]) box.size[glm::length_t(k)] = *known[k];
    if (top.empty() && !known[2]) box.size.z = height_by_tags(part, box, ground);
    box.foot = 0.25 * (feet[0] + feet[1] + feet[2] + feet[3]);
    if (!on && bottom.empty()) box.foot -= box.size.z * up;
    if (!(box.size.x > 1e-4 && box.size.y > 1e-4 && box.size.z > 1e-4))
      refuse(
          fmt::format("box \"{}\": its corners disagree, because its size would be "
                      "{:.1f} x {:.1f} x "
                      "{:.1f} mm; check that they are listed in order around, and bottom corners "
                      "below top ones",
                      part.name, 1000 * box.size.x, 1000 * box.size.y, 1000 * box.size.z));
  }

  // Returns how high a tag lies on top of the box.
  double height_by_tags(const BoxPart& part, const Box& box, const glm::dvec3& ground) const {
    for (const int id : part.tags) {
      const set::Tag& flat = tag(id, part.name);
      if (side_below(flat, box) == std::pair<std::size_t, bool>(2, true))
        return glm::dot(mean_of(below_corners_of(flat, part.tag_thickness_m)) - ground,
                        box.axes[2]);
    }
    refuse(
        fmt::format("box \"{}\" has no corner of its upper side marked and no tag on it; mark a "
                    "corner, or give "
                    "height_m",
                    part.name));
  }

  glm::dvec3 up_of(const BoxPart& part, const Points& top, const Points& bottom) const {
    const Points& side = top.size() >= bottom.size() ? top : bottom;
    if (side.size() < 3)
      refuse(fmt::format(
          "box \"{}\": it stands on no plane, and fewer than 3 corners of one side are known; mark "
          "more of them, or name the plane it stands on",
          part.name));
    const glm::dvec3 up = flattest(side).first;
    const glm::dvec3 towards = bottom.empty() ? mean_of(eyes_) - mean_of(top)
                               : top.empty()  ? mean_of(eyes_) - mean_of(bottom)
                                              : mean_of(top) - mean_of(bottom);
    return glm::dot(up, towards) < 0 ? -up : up;
  }

  void start_box_by_tags(const BoxPart& part) {
    Box& box = shape_.boxes.back();
    const std::optional<std::size_t> on = layout_.box_on.back();
    const glm::dmat4& first = tag(part.tags.front(), part.name).world_from_tag;
    const glm::dvec3 up = on ? shape_.planes[*on].normal : glm::dvec3(first[2]);
    const glm::dvec3 right(first[0]), over(first[1]);
    // An upright vector has no direction on the ground but that of its rounding.
    const bool is_level = std::abs(glm::dot(right, up)) <= std::abs(glm::dot(over, up));
    box.axes = upright_axes(is_level ? right : over, up);
    std::array<std::optional<double>, 3> low, high;  // where its sides are along its axes
    if (on) low[2] = glm::dot(shape_.planes[*on].at, box.axes[2]);
    for (const int id : part.tags) {
      const set::Tag& flat = tag(id, part.name);
      const auto [axis, is_far] = side_below(flat, box);
      const double at = glm::dot(mean_of(below_corners_of(flat, part.tag_thickness_m)),
                                 box.axes[glm::length_t(axis)]);
      (is_far ? high : low)[axis] = at;
    }
    const auto known = known_sizes(part, false);
    const char* const names[] = {"length_m", "width_m", "height_m"};
    glm::dvec3 middle(0);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = glm::length_t(k);
      if (known[k] && low[k] && !high[k]) high[k] = *low[k] + *known[k];
      if (known[k] && high[k] && !low[k]) low[k] = *high[k] - *known[k];
      if (!low[k] || !high[k])
        refuse(fmt::format(
            "box \"{}\" shows one side only along its {}; put a tag on the opposite side, mark its "
            "corners, or give {} and a tag on one of the two sides",
            part.name, std::string(names[k]).substr(0, std::string(names[k]).size() - 2),
            names[k]));
      box.size[axis] = known[k].value_or(*high[k] - *low[k]);
      middle += (k == 2 ? *low[k] : 0.5 * (*low[k] + *high[k])) * box.axes[axis];
    }
    box.foot = middle;
  }

  static std::pair<std::size_t, bool> side_below(const set::Tag& tag, const Box& box) {
    const glm::dvec3 out = glm::transpose(box.axes) * glm::dvec3(tag.world_from_tag[2]);
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::abs(out[glm::length_t(k)]) > std::abs(out[glm::length_t(axis)])) axis = k;
    return {axis, out[glm::length_t(axis)] > 0};
  }

  void bind_to_side(const set::Tag& tag, double thickness_m, std::size_t box) {
    const auto [axis, is_far] = side_below(tag, shape_.boxes[box]);
    layout_.tags.push_back({&tag, thickness_m, box, true, axis, is_far});
  }

  void start_cylinder(const CylinderPart& part) {
    const std::size_t on = plane_named(part.on), index = shape_.cylinders.size();
    layout_.cylinder_on.push_back(on);
    const Plane& plane = shape_.planes[on];
    for (const std::string& point : part.top)
      bind(point, {Place::Kind::upper_rim, index, 0}, part.name);
    for (const std::string& point : part.bottom)
      bind(point, {Place::Kind::lower_rim, index, 0}, part.name);
    // The height at which the rays of the upper rim, and those of the lower one on the plane, lie
    // best on one circle.
    constexpr int trials = 400;
    constexpr double lowest_m = 2e-3, highest_m = 3;
    Cylinder best;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < trials; ++i) {
      const double height =
          part.height_m.value_or(lowest_m * std::pow(highest_m / lowest_m, i / double(trials - 1)));
      const auto [cylinder, off] = on_circle(part, plane, height);
      if (off < least) {
        least = off;
        best = cylinder;
      }
      if (part.height_m) break;
    }
    if (!std::isfinite(least) || best.radius <= 0)
      refuse(
          fmt::format("cylinder \"{}\": no circle fits the points on its rims; check that they are "
                      "on the rims, "
                      "and mark them in two pictures from different sides",
                      part.name));
    if (part.diameter_m) best.radius = *part.diameter_m / 2;
    shape_.cylinders.push_back(best);
  }

  // Returns the cylinder of this height that fits the rims, and how far they are off, over its
  // radius.
  std::pair<Cylinder, double> on_circle(const CylinderPart& part, const Plane& plane,
                                        double height) const {
    std::vector<glm::dvec2> flat;
    const std::array<glm::dvec3, 2> axes = across(plane.normal);
    const glm::dvec3 &x = axes[0], &y = axes[1];
    const auto add = [&](const std::vector<std::string>& names, double above) {
      const Plane at{plane.at + above * plane.normal, plane.normal};
      for (const std::string& point : names)
        for (const Ray& ray : rays_.at(point))
          if (const auto met = meet(ray, at))
            flat.emplace_back(glm::dot(*met - at.at, x), glm::dot(*met - at.at, y));
    };
    add(part.top, height);
    add(part.bottom, 0);
    // x^2 + y^2 + a x + b y + c = 0 (Kasa 1976).
    cv::Mat1d rows(int(flat.size()), 3), right(int(flat.size()), 1), solution;
    for (int i = 0; i < rows.rows; ++i) {
      const glm::dvec2 p = flat[std::size_t(i)];
      rows(i, 0) = p.x, rows(i, 1) = p.y, rows(i, 2) = 1;
      right(i) = -glm::dot(p, p);
    }
    const std::pair<Cylinder, double> none{{}, std::numeric_limits<double>::infinity()};
    if (flat.size() < 3 || !cv::solve(rows, right, solution, cv::DECOMP_SVD)) return none;
    const glm::dvec2 centre(-0.5 * solution(0), -0.5 * solution(1));
    const double radius = std::sqrt(glm::dot(centre, centre) - solution(2));
    if (!(radius > 1e-4)) return none;
    double squares = 0;
    for (const glm::dvec2& p : flat) squares += std::pow(glm::distance(p, centre) - radius, 2);
    if (part.diameter_m)
      squares += double(flat.size()) * std::pow(radius - *part.diameter_m / 2, 2);
    return {{plane.at + centre.x * x + centre.y * y, plane.normal, radius, height},
            std::sqrt(squares / double(flat.size())) / radius};
  }

  void start_points() {
    std::set<std::string> used;
    for (const PlanePart& part : parts_.planes)
      for (const std::string& point : points_on(part)) used.insert(point);
    for (const ScanPart& part : parts_.scans)
      for (const ScanPoint& point : part.points) used.insert(point.name);
    for (const auto& [point, rays] : rays_) {
      if (layout_.places.contains(point)) continue;
      if (!used.contains(point)) {
        layout_.unused_points.push_back(point);
        continue;
      }
      layout_.places[point] = {Place::Kind::free, layout_.free_points.size(), 0};
      layout_.free_points.push_back(point);
      shape_.points.push_back(free_place_of(point));
    }
  }

  // Rays that show no distance are cut by a plane that the point lies on.
  glm::dvec3 free_place_of(const std::string& point) const {
    if (const auto place = place_of(point)) return *place;
    for (std::size_t i = 0; i < parts_.planes.size(); ++i)
      if (lies_on(parts_.planes[i], point))
        if (const auto met = meet(rays_.at(point).front(), shape_.planes[i])) return *met;
    return needed_place_of(point);
  }

  static bool lies_on(const PlanePart& part, const std::string& point) {
    const std::vector<std::string> names = points_on(part);
    return std::ranges::find(names, point) != names.end();
  }

  void check_rooms() const {
    for (const RoomPart& room : parts_.rooms)
      for (std::size_t i = 0; i < room.walls.size(); ++i) {
        const std::string &a = room.walls[i], &b = room.walls[(i + 1) % room.walls.size()];
        const glm::dvec3 across_both =
            glm::cross(shape_.planes[plane_named(a)].normal, shape_.planes[plane_named(b)].normal);
        const double angle = std::asin(std::min(1.0, glm::length(across_both)));
        if (angle < least_angle)
          refuse(
              fmt::format("room \"{}\": its walls \"{}\" and \"{}\" follow each other but are "
                          "parallel to {:.1f} degrees, so "
                          "they do not meet; list the walls in order around, each once",
                          room.name, a, b, angle / degree));
      }
  }

  const Parts& parts_;
  const Views& views_;
  const std::vector<set::Tag>& tags_;
  std::map<std::string, std::vector<Ray>> rays_;  // by point
  Points eyes_;
  Layout layout_;
  Shape shape_;
};

}  // namespace

Start first_guess(const Parts& parts, const Views& views, const std::vector<set::Tag>& tags) {
  return Starter(parts, views, tags).start();
}

glm::dvec3 place_of(const Shape& shape, const Place& place) {
  if (place.kind == Place::Kind::box_corner) return corner(shape.boxes[place.part], place.corner);
  return shape.points.at(place.part);
}

std::array<glm::dvec3, 4> corners_of(const set::Tag& tag) {
  std::array<glm::dvec3, 4> corners;
  for (std::size_t i = 0; i < 4; ++i)
    corners[i] =
        glm::dvec3(tag.world_from_tag * glm::dvec4(tracking::tag_corner(tag.size_m, i), 1));
  return corners;
}

Plane ground_of(const FlatTag& flat, const Shape& shape) {
  if (!flat.is_on_box) return shape.planes[flat.part];
  return side_of(shape.boxes[flat.part], flat.axis, flat.is_far);
}

void settle(const Layout& layout, Shape& shape) {
  for (std::size_t i = 0; i < shape.planes.size(); ++i)
    if (const auto on = layout.plane_on[i]) {
      const glm::dvec3 up = shape.planes[*on].normal;
      glm::dvec3& normal = shape.planes[i].normal;
      normal = glm::normalize(normal - glm::dot(normal, up) * up);
    }
  for (std::size_t i = 0; i < shape.boxes.size(); ++i)
    if (const auto on = layout.box_on[i]) {
      const Plane& plane = shape.planes[*on];
      Box& box = shape.boxes[i];
      box.axes = upright_axes(box.axes[0], plane.normal);
      box.foot -= glm::dot(box.foot - plane.at, plane.normal) * plane.normal;
    }
  for (std::size_t i = 0; i < shape.cylinders.size(); ++i) {
    const Plane& plane = shape.planes[layout.cylinder_on[i]];
    Cylinder& cylinder = shape.cylinders[i];
    cylinder.axis = plane.normal;
    cylinder.foot -= glm::dot(cylinder.foot - plane.at, plane.normal) * plane.normal;
  }
}

std::array<std::optional<double>, 3> known_sizes(const BoxPart& part, bool is_clockwise) {
  if (is_clockwise) return {part.width_m, part.length_m, part.height_m};
  return {part.length_m, part.width_m, part.height_m};
}

}  // namespace previz::model
