// Finds the shift in a picture on which pieces of edges agree.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

namespace previz::fit {

// Edges of light are looked for within this distance.
inline constexpr double reach_px = 12;

// An edge of light near a piece of an edge of the model.
struct Light {
  double along_normal_px = 0;  // from the piece's middle to that of the light
  double off_px = 0;           // from the piece's ends to the light, >= 0, the mean of both
};

// A piece of an edge that has edges of light nearby.
struct EdgeSample {
  glm::dvec2 normal{0};
  std::vector<Light> lights;  // not empty
  glm::dvec2 at{0};           // the middle of the piece, on the pinhole plane
  std::size_t part = 0;       // in RealModel::parts(), or no_part
  // How the piece moves in the picture, right and down, if its part does in the world.
  std::array<glm::dvec3, 2> px_per_m{};
};

// Returns the edge of light that is nearest to where the piece is after a shift.
const Light& nearest(const EdgeSample& sample, const glm::dvec2& shift);

// Edges agree on a shift within this.
inline constexpr double agree_px = 1;
// A shift that is a pixel longer must convince so many more of the pieces.
inline constexpr double share_per_px = 0.005;

// Returns 1 for a piece that has light where a shift brings it, less for one that has it nearby,
// and 0 for one that has none within a distance.
double agreement(const EdgeSample& sample, const glm::dvec2& shift, double within_px = agree_px);

// What pieces say about every shift within reach_px, to half a pixel on either axis. A picture has
// edges of light that are not the model's, and each piece alone would take the nearest: of a model
// that is off, that is mostly another's.
class Votes {
 public:
  Votes();

  void add(const EdgeSample& sample);
  void add(const Votes& others);
  // Returns the votes of all pieces but `some` of them.
  Votes without(const Votes& some) const;

  std::size_t pieces() const { return pieces_; }
  // Returns the shift on which most pieces agree, the shorter of two that are alike.
  glm::dvec2 best() const;
  // Returns how many pieces agree on a shift, 0 to pieces(); one that agrees to a part of a pixel
  // counts in part.
  double agreed(const glm::dvec2& shift) const;

 private:
  std::size_t pieces_ = 0;
  std::vector<double> sums_;  // row by row
};

}  // namespace previz::fit
