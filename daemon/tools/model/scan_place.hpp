// Places a scan rigidly in the world, by points that are known in both.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/model/parts.hpp"

namespace previz::model {

struct PointPair {
  std::string name;
  glm::dvec3 in_scan{0};   // in the scan's unit
  glm::dvec3 in_world{0};  // metres
  int tag = -1;            // whose corner it is; -1: a marked point
};

struct Placement {
  glm::dmat3 rotation{1.0};  // world_from_scan, of a scan in metres
  glm::dvec3 translation{0};
  double rms_m = 0;       // of the points' distances
  double best_scale = 1;  // the size at which its points would fit best
};

double metres(LengthUnit unit);

// Least squares by a rotation and a translation (Kabsch 1976; Umeyama 1991, eq. 34-43). Throws
// previz::Error, "SUBJECT: ...", naming the points at fault: they lie on one line, the scan has
// another size (with the likely unit), a mirrored scan would fit, or a point is off by more than
// most_off_fraction of the largest distance between two of them. A corner of a tag must not be off
// by more than most_off_side of the tag's side, either, or by two pixels of the colours, whose size
// on the surface is `grain_m`, if that is more. At least three points, all of them marked or all of
// them corners of tags, four of each.
Placement place_scan(const std::string& subject, const std::vector<PointPair>& points,
                     double unit_m, double grain_m = 0);
inline constexpr double most_off_fraction = 0.03, most_off_side = 0.1;

// Returns the unit in which the points fit best.
LengthUnit likely_unit(const std::vector<PointPair>& points);

// Returns the axis of the scan that would be nearest to the world's Z.
UpAxis likely_up(const std::vector<PointPair>& points);

}  // namespace previz::model
