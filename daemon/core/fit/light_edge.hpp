// Finds the edge of light that a picture has where a model has a straight edge.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/tracking/edge.hpp"
#include "drivers/calibration.hpp"

namespace previz::fit {

// So much of an edge is left out at either end, where other edges meet it.
inline constexpr double corner_px = 4;
// No piece of an edge is shorter.
inline constexpr double shortest_px = 12;
// The areas beside an edge must be plain so far.
inline constexpr double depth_px = 4;

// A part of an edge: shares of its length in the picture, 0 to 1.
struct Share {
  double from = 0, to = 1;
};

// Cuts an edge of this length into pieces of 12 to 40 px that are alike, less a margin at either
// end. Returns nothing of an edge that is too short for one.
std::vector<Share> cut(double length_px, double margin_px);

// Returns where a pinhole shows a point of the camera's axes (tracking::EdgeGuess); nothing behind
// it.
std::optional<glm::dvec2> on_pinhole(const PinholeIntrinsics& lens, const glm::dvec3& in_camera);

// Returns the pixel in which the lens shows a point of the pinhole plane; nothing if that is
// outside the picture, or within depth_px of its border.
std::optional<glm::dvec2> pixel_of(const PinholeIntrinsics& lens, const glm::dvec2& on_pinhole);

// Returns the edge of light within about 2 px of a line from a to b on the pinhole plane. An edge
// that differs by too little light, that something covers, or beside which the areas are not plain
// is not found.
std::optional<tracking::EdgeFit> find_light(const tracking::Luminance& luminance,
                                            const PinholeIntrinsics& lens, const glm::dvec2& a,
                                            const glm::dvec2& b);

}  // namespace previz::fit
