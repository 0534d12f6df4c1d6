#include "daemon/core/fit/translation.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace previz::fit {
namespace {

// Ways are tried for every pixel.
constexpr int steps_to_reach = int(reach_px);
constexpr int rounds_of_translation = 5;

// Returns the metres that are a pixel across the picture, in the mean.
double mean_metres_per_px(const std::vector<EdgeSample>& pieces) {
  double px_per_m = 0;
  for (const EdgeSample& piece : pieces) px_per_m += glm::length(piece.px_per_m[0]);
  return double(pieces.size()) / px_per_m;
}

// Returns the translation among those to the corners of a lattice of a pixel. None of all
// translations is farther than 0.87 px from one of them, so that pieces agree within 2 px.
glm::dvec3 coarse_translation(const std::vector<EdgeSample>& pieces, double metres_per_px) {
  glm::dvec3 best(0);
  double most = -1;
  for (int z = -steps_to_reach; z <= steps_to_reach; ++z)
    for (int y = -steps_to_reach; y <= steps_to_reach; ++y)
      for (int x = -steps_to_reach; x <= steps_to_reach; ++x) {
        const glm::dvec3 translation_px(x, y, z), translation_m = metres_per_px * translation_px;
        double sum = -share_per_px * double(pieces.size()) * glm::length(translation_px);
        std::size_t left = pieces.size();
        for (const EdgeSample& piece : pieces) {
          sum += agreement(piece, shift_by(piece, translation_m), 2);
          // A piece agrees by 1 at most, so that those that are left cannot make up for the rest.
          if (sum + double(--left) < most) break;
        }
        if (sum > most) most = sum, best = translation_m;
      }
  return best;
}

// Moves a translation to where the pieces that agree on it do so best: least squares, in which what
// the pictures do not show stays as it is.
glm::dvec3 refined_translation(const std::vector<EdgeSample>& pieces,
                               const glm::dvec3& translation_m, double metres_per_px) {
  glm::dmat3 squares(1e-3 * double(pieces.size()));
  glm::dvec3 products(0);
  for (const EdgeSample& piece : pieces) {
    const glm::dvec2 shift = shift_by(piece, translation_m);
    const double off_px = nearest(piece, shift).along_normal_px - glm::dot(piece.normal, shift);
    if (std::abs(off_px) > agree_px) continue;
    const glm::dvec3 gains =
        metres_per_px * (piece.normal.x * piece.px_per_m[0] + piece.normal.y * piece.px_per_m[1]);
    squares += glm::outerProduct(gains, gains);
    products += off_px * gains;
  }
  return translation_m + metres_per_px * (glm::inverse(squares) * products);
}

}  // namespace

glm::dvec2 shift_by(const EdgeSample& piece, const glm::dvec3& translation_m) {
  return {glm::dot(piece.px_per_m[0], translation_m), glm::dot(piece.px_per_m[1], translation_m)};
}

glm::dvec3 agreed_translation(const std::vector<EdgeSample>& pieces) {
  const double metres_per_px = mean_metres_per_px(pieces);
  glm::dvec3 translation_m = coarse_translation(pieces, metres_per_px);
  for (int round = 0; round < rounds_of_translation; ++round)
    translation_m = refined_translation(pieces, translation_m, metres_per_px);
  return translation_m;
}

}  // namespace previz::fit
