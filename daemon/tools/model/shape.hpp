// The geometry of a model while it is adjusted: what each part is, in the world. Plain data.
#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/tracking/camera_pose.hpp"

namespace previz::model {

struct Plane {
  glm::dvec3 at{0};
  glm::dvec3 normal{0, 0, 1};  // unit, towards the cameras
};

struct Box {
  glm::dvec3 foot{0};    // centre of its lower side
  glm::dmat3 axes{1.0};  // columns, a right-handed rotation: along its length, its width and up
  glm::dvec3 size{0};    // length, width, height, metres
};

struct Cylinder {
  glm::dvec3 foot{0};  // centre of its lower side
  glm::dvec3 axis{0, 0, 1};
  double radius = 0, height = 0;
};

// In the order of the parts. Points are those that are no corner of a box and on no rim.
struct Shape {
  std::vector<Plane> planes;
  std::vector<Box> boxes;
  std::vector<Cylinder> cylinders;
  std::vector<glm::dvec3> points;
  // How far each picture's camera is from where its tags put it: rotation (rad) and shift (m)
  // along its own axes.
  std::vector<std::array<double, 6>> cameras_off;
};

// Returns a corner: 0 to 3 below, 4 to 7 above them, each counter-clockwise seen from above. The
// first edge, from 0 to 1, is along the length.
glm::dvec3 corner(const Box& box, std::size_t index);

// Returns the plane of one of its sides: the one at the far or the near end of its axis `axis`. The
// normal looks outwards.
Plane side_of(const Box& box, std::size_t axis, bool is_far);

// Returns the point of a rim, the upper or the lower one, that is nearest to where this ray meets
// the rim's plane; the rim's centre if the ray is parallel to it.
glm::dvec3 rim_point(const Cylinder& cylinder, bool upper, const glm::dvec3& origin,
                     const glm::dvec3& direction);

// Two unit vectors that are at right angles to each other and to this unit vector.
std::array<glm::dvec3, 2> across(const glm::dvec3& axis);

// Returns the rotation whose third axis is `up`, a unit vector, and whose first is as near to
// `along` as that allows.
glm::dmat3 upright_axes(const glm::dvec3& along, const glm::dvec3& up);

}  // namespace previz::model
