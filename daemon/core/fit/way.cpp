#include "daemon/core/fit/way.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace previz::fit {
namespace {

// Ways are tried for every pixel.
constexpr int ways_to_reach = int(reach_px);
constexpr int rounds_of_way = 5;

// Returns the metres that are a pixel across the picture, in the mean.
double metres_of_px(const std::vector<Looked>& pieces) {
  double px_per_m = 0;
  for (const Looked& piece : pieces) px_per_m += glm::length(piece.px_per_m[0]);
  return double(pieces.size()) / px_per_m;
}

// Returns the way among those to the corners of a lattice of a pixel. None of all ways is farther
// than 0.87 px from one of them, so that pieces agree within 2 px.
glm::dvec3 coarse_way(const std::vector<Looked>& pieces, double metres_of_a_px) {
  glm::dvec3 best(0);
  double most = -1;
  for (int z = -ways_to_reach; z <= ways_to_reach; ++z)
    for (int y = -ways_to_reach; y <= ways_to_reach; ++y)
      for (int x = -ways_to_reach; x <= ways_to_reach; ++x) {
        const glm::dvec3 way_px(x, y, z), way_m = metres_of_a_px * way_px;
        double sum = -share_a_px * double(pieces.size()) * glm::length(way_px);
        std::size_t left = pieces.size();
        for (const Looked& piece : pieces) {
          sum += agreement(piece, shift_by(piece, way_m), 2);
          // A piece agrees by 1 at most, so that those that are left cannot make up for the rest.
          if (sum + double(--left) < most) break;
        }
        if (sum > most) most = sum, best = way_m;
      }
  return best;
}

// Moves a way to where the pieces that agree on it do so best: least squares, in which what the
// pictures do not show stays as it is.
glm::dvec3 bettered_way(const std::vector<Looked>& pieces, const glm::dvec3& way_m,
                        double metres_of_a_px) {
  glm::dmat3 squares(1e-3 * double(pieces.size()));
  glm::dvec3 products(0);
  for (const Looked& piece : pieces) {
    const glm::dvec2 shift = shift_by(piece, way_m);
    const double off_px = nearest(piece, shift).along_normal_px - glm::dot(piece.normal, shift);
    if (std::abs(off_px) > agree_px) continue;
    const glm::dvec3 gains =
        metres_of_a_px * (piece.normal.x * piece.px_per_m[0] + piece.normal.y * piece.px_per_m[1]);
    squares += glm::outerProduct(gains, gains);
    products += off_px * gains;
  }
  return way_m + metres_of_a_px * (glm::inverse(squares) * products);
}

}  // namespace

glm::dvec2 shift_by(const Looked& piece, const glm::dvec3& way_m) {
  return {glm::dot(piece.px_per_m[0], way_m), glm::dot(piece.px_per_m[1], way_m)};
}

glm::dvec3 agreed_way(const std::vector<Looked>& pieces) {
  const double metres_of_a_px = metres_of_px(pieces);
  glm::dvec3 way_m = coarse_way(pieces, metres_of_a_px);
  for (int round = 0; round < rounds_of_way; ++round)
    way_m = bettered_way(pieces, way_m, metres_of_a_px);
  return way_m;
}

}  // namespace previz::fit
