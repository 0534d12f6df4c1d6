// A scene that is known, and what a person would mark in pictures of it.
#pragma once

#include "daemon/tools/model/fit.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

struct MarkedScene {
  std::vector<set::Tag> tags;
  std::vector<glm::dmat4> cameras;  // world_from_camera
  std::map<std::string, glm::dvec3> points;
  PinholeIntrinsics lens;
  double mark_px = 0;  // noise of the marks
  double pose_m = 0;   // noise of the poses' position; their rotation has as much over a metre

  // Pictures are named "0", "1", ... All points are marked in all of them.
  std::vector<model::MarkedPicture> pictures(std::mt19937& random) const;
  // The views as the tags would give them, beside their noise.
  model::Views views(const model::Parts& parts, std::mt19937& random) const;
};

// Returns three tags flat on the table z = 0, and five cameras around it.
MarkedScene scene_of_a_table();

// Adds the corners of a box that stands on the table under PREFIXt1..4 and PREFIXb1..4,
// counter-clockwise seen from above; t is above. Returns its size.
void add_box(MarkedScene& scene, const std::string& prefix, glm::dvec3 foot, glm::dvec3 size,
             double turn_rad);

// Returns the names of add_box's upper ('t') or lower ('b') corners.
std::vector<std::string> corners(const std::string& prefix, char side);

// Parses the parts behind the scene's marks, guesses and adjusts.
model::Fit fit_of(const MarkedScene& scene, model::Parts parts, unsigned seed = 1);

}  // namespace previz::test
