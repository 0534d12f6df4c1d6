#include "daemon/tools/model/unknowns.hpp"

#include <glm/geometric.hpp>

#include "daemon/core/tracking/camera_pose.hpp"

namespace previz::model {
namespace {

glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& by) {
  return tracking::rotation_by(by) * v;
}

// A plane moves along its normal and turns about two axes in it, or about the normal of what it
// stands on.
void add_plane(std::size_t i, const std::string& name, std::optional<std::size_t> on,
               std::vector<Unknown>& all) {
  all.push_back({name, [i](Shape& s, double by) { s.planes[i].at += by * s.planes[i].normal; }});
  if (on) {
    all.push_back({name, [i, below = *on](Shape& s, double by) {
                     s.planes[i].normal = turned(s.planes[i].normal, by * s.planes[below].normal);
                   }});
    return;
  }
  for (const std::size_t k : {0, 1})
    all.push_back({name, [i, k](Shape& s, double by) {
                     glm::dvec3& normal = s.planes[i].normal;
                     normal = turned(normal, by * across(normal)[k]);
                   }});
}

// A box that stands on a plane moves in it and turns about its upright axis.
void add_box(std::size_t i, const BoxPart& part, bool stands, bool is_clockwise,
             std::vector<Unknown>& all) {
  for (glm::length_t k = 0; k < (stands ? 2 : 3); ++k)
    all.push_back(
        {part.name, [i, k](Shape& s, double by) { s.boxes[i].foot += by * s.boxes[i].axes[k]; }});
  for (glm::length_t k = stands ? 2 : 0; k < 3; ++k)
    all.push_back({part.name, [i, k](Shape& s, double by) {
                     glm::dmat3& axes = s.boxes[i].axes;
                     axes = tracking::orthonormal(tracking::rotation_by(by * axes[k]) * axes);
                   }});
  const auto known = known_sizes(part, is_clockwise);
  for (glm::length_t k = 0; k < 3; ++k)
    if (!known[std::size_t(k)])
      all.push_back({part.name, [i, k](Shape& s, double by) { s.boxes[i].size[k] += by; }});
}

void add_cylinder(std::size_t i, const CylinderPart& part, std::vector<Unknown>& all) {
  for (const std::size_t k : {0, 1})
    all.push_back({part.name, [i, k](Shape& s, double by) {
                     s.cylinders[i].foot += by * across(s.cylinders[i].axis)[k];
                   }});
  if (!part.diameter_m)
    all.push_back({part.name, [i](Shape& s, double by) { s.cylinders[i].radius += by; }});
  if (!part.height_m)
    all.push_back({part.name, [i](Shape& s, double by) { s.cylinders[i].height += by; }});
}

}  // namespace

std::vector<Unknown> unknowns_of(const Parts& parts, const Start& start) {
  const Layout& layout = start.layout;
  std::vector<Unknown> all;
  for (std::size_t i = 0; i < parts.planes.size(); ++i)
    add_plane(i, parts.planes[i].name, layout.plane_on[i], all);
  for (std::size_t i = 0; i < parts.boxes.size(); ++i)
    add_box(i, parts.boxes[i], layout.box_on[i].has_value(), layout.is_clockwise[i], all);
  for (std::size_t i = 0; i < parts.cylinders.size(); ++i) add_cylinder(i, parts.cylinders[i], all);
  for (std::size_t i = 0; i < start.shape.points.size(); ++i)
    for (glm::length_t k = 0; k < 3; ++k)
      all.push_back({layout.free_points[i], [i, k](Shape& s, double by) { s.points[i][k] += by; }});
  for (std::size_t i = 0; i < start.shape.cameras_off.size(); ++i)
    for (std::size_t k = 0; k < 6; ++k)
      all.push_back({"camera", [i, k](Shape& s, double by) { s.cameras_off[i][k] += by; }});
  return all;
}

}  // namespace previz::model
