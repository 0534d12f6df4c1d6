#include "daemon/tools/model/solids.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numbers>

#include "daemon/core/tracking/camera_pose.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

constexpr int cylinder_sides = 48;
// A point that is farther behind a wall than this is not at its foot.
constexpr double behind_m = 5e-3;
// A picture's upper edge is looked along in so many steps.
constexpr int steps_across = 256;
// A face hides nothing that is beyond it by less than this share of the distance.
constexpr double hidden_share = 2e-3;

using Points = std::vector<glm::dvec3>;

glm::dvec3 onto(const Plane& plane, const glm::dvec3& p) {
  return p - glm::dot(p - plane.at, plane.normal) * plane.normal;
}

// Returns the part of a convex polygon that is in front of the plane (Sutherland and Hodgman 1974).
Points clipped(const Points& polygon, const Plane& by) {
  Points kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = glm::dot(a - by.at, by.normal), db = glm::dot(b - by.at, by.normal);
    if (da >= 0) kept.push_back(a);
    if ((da >= 0) != (db >= 0)) kept.push_back(a + da / (da - db) * (b - a));
  }
  return kept;
}

// Returns whether the segment from an eye to a point passes through the face, before its end.
bool hides(const Face& face, const glm::dvec3& eye, const glm::dvec3& point) {
  const glm::dvec3 normal = normal_of(face);
  const double from = glm::dot(eye - face.outline[0], normal);
  const double to = glm::dot(point - face.outline[0], normal);
  if (from == to) return false;
  const double t = from / (from - to);
  if (!(t > 0 && t < 1 - hidden_share)) return false;
  return is_in(face, eye + t * (point - eye));
}

class Solids {
 public:
  Solids(const Parts& parts, const Layout& layout, const Shape& shape, const Views* views)
      : parts_(parts), layout_(layout), shape_(shape), views_(views) {}

  std::vector<Solid> all() const {
    std::vector<Solid> solids;
    for (std::size_t i = 0; i < parts_.planes.size(); ++i)
      if (!belongs_to_room(parts_.planes[i].name)) solids.push_back(plane(i));
    for (std::size_t i = 0; i < parts_.boxes.size(); ++i) solids.push_back(box(i));
    for (std::size_t i = 0; i < parts_.cylinders.size(); ++i) solids.push_back(cylinder(i));
    for (const RoomPart& part : parts_.rooms) solids.push_back(room(part));
    return solids;
  }

 private:
  bool belongs_to_room(const std::string& name) const {
    return std::ranges::any_of(parts_.rooms, [&](const RoomPart& room) {
      return room.floor == name || std::ranges::find(room.walls, name) != room.walls.end();
    });
  }

  const Plane& plane_named(const std::string& name) const {
    const auto part = std::ranges::find(parts_.planes, name, &PlanePart::name);
    return shape_.planes[std::size_t(part - parts_.planes.begin())];
  }

  glm::dvec3 place_of(const std::string& point) const {
    return model::place_of(shape_, layout_.places.at(point));
  }

  // Returns what lies or stands on a plane.
  Points things_on(std::size_t index) const {
    Points on_it;
    for (const FlatTag& flat : layout_.tags)
      if (!flat.is_on_box && flat.part == index)
        for (const glm::dvec3& p : corners_of(*flat.tag)) on_it.push_back(p);
    for (const std::string& point : points_on(parts_.planes[index]))
      on_it.push_back(place_of(point));
    for (std::size_t i = 0; i < shape_.boxes.size(); ++i)
      for (std::size_t k = 0; layout_.box_on[i] == index && k < 4; ++k)
        on_it.push_back(corner(shape_.boxes[i], k));
    for (std::size_t i = 0; i < shape_.cylinders.size(); ++i)
      if (layout_.cylinder_on[i] == index)
        for (const glm::dvec3& way : across(shape_.cylinders[i].axis))
          for (const double sign : {-1, 1})
            on_it.push_back(shape_.cylinders[i].foot + sign * shape_.cylinders[i].radius * way);
    for (std::size_t i = 0; i < shape_.planes.size(); ++i)
      if (layout_.plane_on[i] == index)
        for (const glm::dvec3& p : things_on(i)) on_it.push_back(p);
    return on_it;
  }

  glm::dvec3 along(std::size_t index) const {
    const glm::dvec3 normal = shape_.planes[index].normal;
    if (const auto on = layout_.plane_on[index])
      return glm::cross(shape_.planes[*on].normal, normal);
    const auto tag = std::ranges::find_if(
        layout_.tags, [&](const FlatTag& flat) { return !flat.is_on_box && flat.part == index; });
    return tag == layout_.tags.end() ? glm::dvec3(1, 0, 0)
                                     : glm::dvec3(tag->tag->world_from_tag[0]);
  }

  // Returns how high on a wall the pictures' upper edges are, above its `at` and within `low` to
  // `high` along its first axis; below everything where they do not show it.
  double top_seen(const Plane& wall, const glm::dmat3& axes, double low, double high) const {
    double top = -std::numeric_limits<double>::infinity();
    for (const MarkedView& view : views_->views)
      for (int i = 0; i <= steps_across; ++i) {
        const double x = double(i) * views_->lens.width / steps_across - 0.5;
        const auto ray = tracking::ray_through(
            views_->lens, tracking::world_from_camera(view.pose.pose), {x, -0.5});
        if (!ray) continue;
        const double t =
            glm::dot(wall.at - ray->origin, wall.normal) / glm::dot(ray->direction, wall.normal);
        if (!(t > 0 && std::isfinite(t))) continue;
        const glm::dvec3 at = ray->origin + t * ray->direction - wall.at;
        const double across = glm::dot(at, axes[0]);
        if (across >= low && across <= high) top = std::max(top, glm::dot(at, axes[1]));
      }
    return top;
  }

  // A rectangle around all that is on the plane. That of an upright plane begins at what it stands
  // on; a wall's goes up to the top of the pictures, and its margin beyond.
  Points rectangle(std::size_t index) const {
    const Plane& plane = shape_.planes[index];
    const double margin = parts_.planes[index].margin_m;
    const glm::dmat3 axes = upright_axes(along(index), plane.normal);
    glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-low);
    for (const glm::dvec3& p : things_on(index)) {
      const glm::dvec2 at(glm::dot(p - plane.at, axes[0]), glm::dot(p - plane.at, axes[1]));
      low = glm::min(low, at);
      high = glm::max(high, at);
    }
    const auto on = layout_.plane_on[index];
    if (on && views_ != nullptr && has_all_before(*on, plane))
      high.y = std::max(high.y, top_seen(plane, axes, low.x, high.x));
    low -= margin;
    high += margin;
    if (on) {
      const Plane& below = shape_.planes[*on];
      low.y = glm::dot(below.at - plane.at, below.normal);
      if (const auto height = parts_.planes[index].height_m) high.y = low.y + *height;
    }
    Points corners;
    for (const glm::dvec2 at : {low, glm::dvec2(high.x, low.y), high, glm::dvec2(low.x, high.y)})
      corners.push_back(plane.at + at.x * axes[0] + at.y * axes[1]);
    return corners;
  }

  // A border is the line through two points; what is on the plane tells its inner side.
  Points ended_at_edges(std::size_t index, Points corners) const {
    const Plane& plane = shape_.planes[index];
    glm::dvec3 middle(0);
    const Points on_it = things_on(index);
    for (const glm::dvec3& p : on_it) middle += p / double(on_it.size());
    for (const auto& [a, b] : parts_.planes[index].edges) {
      const glm::dvec3 from = place_of(a), to = place_of(b);
      glm::dvec3 inwards = glm::cross(plane.normal, to - from);
      if (glm::length(inwards) < 1e-6)
        throw Error(fmt::format(
            "{}: the points \"{}\" and \"{}\" of an edge of plane \"{}\" are the same place; mark "
            "two that are apart",
            parts_.file.string(), a, b, parts_.planes[index].name));
      inwards = glm::normalize(inwards);
      if (glm::dot(middle - from, inwards) < 0) inwards = -inwards;
      corners = clipped(corners, {from, inwards});
    }
    return corners;
  }

  Points outline(std::size_t index) const {
    const PlanePart& part = parts_.planes[index];
    const Plane& plane = shape_.planes[index];
    Points corners;
    for (const std::string& point : part.outline) corners.push_back(onto(plane, place_of(point)));
    int left = 0, right = 0;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const glm::dvec3 &a = corners[i], &b = corners[(i + 1) % corners.size()],
                       &c = corners[(i + 2) % corners.size()];
      (glm::dot(glm::cross(b - a, c - b), plane.normal) > 0 ? left : right) += 1;
    }
    if (left > 0 && right > 0)
      throw Error(
          fmt::format("{}: the outline of plane \"{}\" is not convex; list its corners in order "
                      "around, or make "
                      "two planes of it",
                      parts_.file.string(), part.name));
    if (right > 0) std::ranges::reverse(corners);
    return corners;
  }

  // A wall ends what it stands on and the walls beside it, but for a screen that has some of it
  // behind itself.
  bool has_all_before(std::size_t index, const Plane& wall) const {
    return std::ranges::all_of(things_on(index), [&](const glm::dvec3& p) {
      return glm::dot(p - wall.at, wall.normal) > -behind_m;
    });
  }

  Solid plane(std::size_t index) const {
    const PlanePart& part = parts_.planes[index];
    Points corners =
        part.outline.empty() ? ended_at_edges(index, rectangle(index)) : outline(index);
    for (std::size_t i = 0; i < shape_.planes.size(); ++i) {
      const bool stands_here = layout_.plane_on[i] == index;
      const bool stands_beside =
          i != index && layout_.plane_on[index] && layout_.plane_on[i] == layout_.plane_on[index];
      if ((stands_here || stands_beside) && has_all_before(index, shape_.planes[i]))
        corners = clipped(corners, shape_.planes[i]);
    }
    if (corners.size() < 3)
      throw Error(
          fmt::format("{}: the planes around \"{}\" leave nothing of it; check the points of each",
                      parts_.file.string(), part.name));
    return {part.name, {{"face", corners}}};
  }

  Solid box(std::size_t index) const {
    const Box& box = shape_.boxes[index];
    const auto face = [&](const std::string& name, std::array<std::size_t, 4> corners) {
      Face result{name, {}};
      for (const std::size_t k : corners) result.outline.push_back(corner(box, k));
      return result;
    };
    Solid solid{parts_.boxes[index].name,
                {face("bottom", {3, 2, 1, 0}), face("top", {4, 5, 6, 7})}};
    // A side is named by the corners as they are marked.
    const auto marked = [&](std::size_t k) {
      return 1 + (layout_.is_clockwise[index] ? (4 - k) % 4 : k);
    };
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t next = (k + 1) % 4;
      solid.faces.push_back(face(fmt::format("side {}-{}", std::min(marked(k), marked(next)),
                                             std::max(marked(k), marked(next))),
                                 {k, next, next + 4, k + 4}));
    }
    return solid;
  }

  Solid cylinder(std::size_t index) const {
    const Cylinder& c = shape_.cylinders[index];
    const auto [x, y] = across(c.axis);
    Face top{"top", {}}, bottom{"bottom", {}};
    for (int i = 0; i < cylinder_sides; ++i) {
      const double angle = 2 * std::numbers::pi * i / cylinder_sides;
      const glm::dvec3 rim = c.foot + c.radius * (std::cos(angle) * x + std::sin(angle) * y);
      bottom.outline.push_back(rim);
      top.outline.push_back(rim + c.height * c.axis);
    }
    Solid solid{parts_.cylinders[index].name, {}};
    for (std::size_t i = 0; i < cylinder_sides; ++i) {
      const std::size_t next = (i + 1) % cylinder_sides;
      solid.faces.push_back(
          {"side", {bottom.outline[i], bottom.outline[next], top.outline[next], top.outline[i]}});
    }
    std::ranges::reverse(bottom.outline);
    solid.faces.push_back(top);
    solid.faces.push_back(bottom);
    return solid;
  }

  // Returns where three planes meet.
  static glm::dvec3 meeting_point(const Plane& a, const Plane& b, const Plane& c) {
    const glm::dmat3 rows = glm::transpose(glm::dmat3(a.normal, b.normal, c.normal));
    return glm::inverse(rows) *
           glm::dvec3(glm::dot(a.at, a.normal), glm::dot(b.at, b.normal), glm::dot(c.at, c.normal));
  }

  // Its faces are seen from inside.
  Solid room(const RoomPart& part) const {
    const Plane& floor = plane_named(part.floor);
    const Plane ceiling{floor.at + part.height_m * floor.normal, -floor.normal};
    Points low, high;
    for (std::size_t i = 0; i < 4; ++i) {
      const Plane &wall = plane_named(part.walls[i]), &next = plane_named(part.walls[(i + 1) % 4]);
      low.push_back(meeting_point(floor, wall, next));
      high.push_back(meeting_point(ceiling, wall, next));
    }
    const bool is_clockwise =
        glm::dot(glm::cross(low[2] - low[0], low[3] - low[1]), floor.normal) < 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const glm::dvec3 &a = low[i], &b = low[(i + 1) % 4], &c = low[(i + 2) % 4];
      const double turn = glm::dot(glm::cross(b - a, c - b), floor.normal);
      if (!(is_clockwise ? turn < 0 : turn > 0))
        throw Error(fmt::format(
            "{}: the walls of room \"{}\" do not go around its floor; list them in order "
            "around, and check the points of each",
            parts_.file.string(), part.name));
    }
    Solid solid{part.name, {{"floor", low}, {"ceiling", {high.rbegin(), high.rend()}}}};
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t before = (i + 3) % 4;
      solid.faces.push_back({part.walls[i], {low[i], low[before], high[before], high[i]}});
    }
    if (is_clockwise)
      for (Face& face : solid.faces) std::ranges::reverse(face.outline);
    return solid;
  }

  const Parts& parts_;
  const Layout& layout_;
  const Shape& shape_;
  const Views* views_;
};

}  // namespace

glm::dvec3 normal_of(const Face& face) {
  glm::dvec3 sum(0);  // twice the area (Newell)
  for (std::size_t i = 1; i + 1 < face.outline.size(); ++i)
    sum += glm::cross(face.outline[i] - face.outline[0], face.outline[i + 1] - face.outline[0]);
  return glm::normalize(sum);
}

bool is_in(const Face& face, const glm::dvec3& point) {
  const glm::dvec3 normal = normal_of(face);
  for (std::size_t i = 0; i < face.outline.size(); ++i) {
    const glm::dvec3 &a = face.outline[i], &b = face.outline[(i + 1) % face.outline.size()];
    if (glm::dot(glm::cross(b - a, point - a), normal) < 0) return false;
  }
  return true;
}

NamedMesh mesh_of(const Solid& solid) {
  NamedMesh result{solid.name, {}};
  ShadedMesh& mesh = result.mesh;
  for (const Face& face : solid.faces) {
    const auto first = static_cast<unsigned>(mesh.positions.size());
    for (const glm::dvec3& p : face.outline) {
      mesh.positions.emplace_back(p);
      mesh.normals.emplace_back(normal_of(face));
    }
    for (unsigned i = 1; i + 1 < face.outline.size(); ++i)
      for (const unsigned k : {0u, i, i + 1}) mesh.indices.push_back(first + k);
  }
  return result;
}

bool is_hidden(const std::vector<Solid>& solids, const glm::dvec3& eye, const glm::dvec3& point) {
  for (const Solid& solid : solids)
    for (const Face& face : solid.faces)
      if (hides(face, eye, point)) return true;
  return false;
}

std::vector<Solid> solids_of(const Parts& parts, const Layout& layout, const Shape& shape,
                             const Views* views) {
  return Solids(parts, layout, shape, views).all();
}

}  // namespace previz::model
