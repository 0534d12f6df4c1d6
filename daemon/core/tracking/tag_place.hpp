// Fits the place of one tag to what cameras of known poses see of it.
#pragma once

#include <glm/mat4x4.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/camera_pose.hpp"
#include "daemon/core/tracking/corners.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// A tag as a camera sees it.
struct TagView {
  CameraFromWorld camera;
  CornerPixels corners{};
  double variance_px2 = 0;  // of a corner's coordinate
};

TagView view_of(const TagObservation& tag, const glm::dmat4& world_from_camera);

// Returns where a tag's corners are projected; infinite coordinates if one is behind the camera.
CornerPixels projected_tag(const PinholeIntrinsics& lens, const CameraFromWorld& camera,
                           const glm::dmat4& world_from_tag, double size_m);

// Returns how far the corners lie from their projection, px.
CornerPixels corners_off(const PinholeIntrinsics& lens, const TagView& view,
                         const glm::dmat4& world_from_tag, double size_m);

// Returns the sum of squares of the coordinates.
double squares_of(const CornerPixels& off);

// Returns the squares in standard deviations, by Cauchy's loss of three of them for each view.
double place_cost(const PinholeIntrinsics& lens, std::span<const TagView> views,
                  const glm::dmat4& world_from_tag, double size_m);

// Moves the place to the nearest minimum of place_cost().
glm::dmat4 fitted_place(const PinholeIntrinsics& lens, std::span<const TagView> views,
                        const glm::dmat4& start, double size_m);

// Returns the chi-square of 8 degrees of freedom of a tag's corners by a pose that does not use it,
// against the covariances of both.
double chi_square_of(const PinholeIntrinsics& lens, const TagObservation& tag, const Pose& pose);

// Says why a tag of the set is not where its views have it, and what to do: it is printed at
// another size, exchanged with another of the set's `tags`, moved, turned, or has not stayed in one
// place. There is at least one view.
std::string why_elsewhere(const set::Tag& tag, const std::vector<set::Tag>& tags,
                          const PinholeIntrinsics& lens, std::span<const TagView> views);

}  // namespace previz::tracking
