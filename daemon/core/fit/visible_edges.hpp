// Finds the parts of a model's edges that a camera sees.
#pragma once

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <vector>

#include "daemon/core/fit/real_model.hpp"
#include "drivers/calibration.hpp"

namespace previz::fit {

struct Segment {
  glm::dvec2 a{0}, b{0};
  // These are of measurable_pieces().
  std::size_t part = no_part;  // in RealModel::parts()
  double depth_m = 0;          // of its middle, from the camera's plane
};

// Returns the edges that the model does not hide as segments in pixels of the picture, to draw over
// it; none is longer than 40 px, so that they follow the lens's distortion. An edge ends where it
// is hidden to 4 px, and one that is shorter than that is left out.
std::vector<Segment> visible_segments(const RealModel& model, const PinholeIntrinsics& lens,
                                      const glm::dmat4& world_from_camera);

// Returns a straight line of the world as segments likewise, whether the model hides it or not.
std::vector<Segment> line_segments(const glm::dvec3& a, const glm::dvec3& b,
                                   const PinholeIntrinsics& lens,
                                   const glm::dmat4& world_from_camera);

// Returns the pieces of 12 to 40 px, on the pinhole plane (tracking::EdgeGuess), in which an edge
// of light can be looked for: those of visible edges that nothing touches, and that are farther
// than 8 px from every other visible edge.
std::vector<Segment> measurable_pieces(const RealModel& model, const PinholeIntrinsics& lens,
                                       const glm::dmat4& world_from_camera);

}  // namespace previz::fit
