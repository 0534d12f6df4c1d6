#include "daemon/core/fit/residual.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

namespace previz::fit {
namespace {

// More of the rest agrees after each round.
constexpr int rounds = 10;
// A turn and a growth are in px over this distance.
constexpr double unit_px = 100;
// Turns and growths are held back by this, so that pieces in one place decide on neither.
constexpr double stiffness = 1e-3;

// A motion is a shift, x and y, a turn and a growth about a middle. Returns how it shifts what is
// `away` from there.
glm::dvec2 moved_by(const glm::dvec4& motion, const glm::dvec2& away) {
  return glm::dvec2(motion) + motion.z * glm::dvec2(-away.y, away.x) + motion.w * away;
}

glm::dvec2 middle_of(std::size_t part, const std::vector<EdgeSample>& found) {
  glm::dvec2 sum(0);
  double count = 0;
  for (const EdgeSample& sample : found)
    if (sample.part == part) sum += sample.at, ++count;
  return sum / std::max(1.0, count);
}

// Returns the motion that brings all but one part nearer to the edges of light on which it agrees
// after a motion: least squares over the pieces.
glm::dvec4 refined(const glm::dvec4& motion, const glm::dvec2& middle, std::size_t but_part,
                   const std::vector<EdgeSample>& found) {
  const double hold = stiffness * double(found.size());
  glm::dmat4 squares(1e-9);
  squares[2][2] = squares[3][3] = hold;
  glm::dvec4 products(0);
  for (const EdgeSample& sample : found) {
    if (sample.part == but_part) continue;
    const glm::dvec2 away = (sample.at - middle) / unit_px;
    const glm::dvec2 shift = moved_by(motion, away);
    const double light_px = nearest(sample, shift).along_normal_px;
    if (std::abs(light_px - glm::dot(sample.normal, shift)) > agree_px) continue;
    const glm::dvec4 gains(sample.normal, glm::dot(sample.normal, glm::dvec2(-away.y, away.x)),
                           glm::dot(sample.normal, away));
    squares += glm::outerProduct(gains, gains);
    products += light_px * gains;
  }
  return glm::inverse(squares) * products;
}

glm::dvec2 turned_at(std::size_t part, const std::vector<EdgeSample>& found,
                     const glm::dvec2& common) {
  const glm::dvec2 middle = middle_of(part, found);
  glm::dvec4 motion(common, 0, 0);
  for (int round = 0; round < rounds; ++round) motion = refined(motion, middle, part, found);
  return glm::dvec2(motion);
}

}  // namespace

std::optional<ResidualShift> residual_shift(std::size_t part, const Votes& rest,
                                            const std::vector<EdgeSample>& found) {
  if (rest.pieces() < least_pieces) return {};
  const glm::dvec2 common = rest.best();
  if (glm::length(common) > most_off_px) return {};
  if (rest.agreed(common) < most_of * double(rest.pieces())) return {};
  return ResidualShift{common, turned_at(part, found, common)};
}

}  // namespace previz::fit
