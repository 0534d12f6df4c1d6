// Finds the edges of a model in its pictures, to a tenth of a pixel.
#pragma once

#include <glm/vec2.hpp>
#include <vector>

#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/views.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

// A piece of a face's edge, and the straight edge of light that a picture has there. Points are on
// the pinhole plane (tracking::EdgeGuess).
struct EdgePiece {
  std::size_t view = 0, solid = 0, face = 0,
              edge = 0;     // from corner `edge` of the face to the next
  double from = 0, to = 1;  // shares of that edge
  glm::dvec2 a{0}, b{0};    // where the picture has its ends
  double variance_px2 = 0;  // of their distance across it
};

// Looks for every edge of the boxes, of planes with an outline and of rooms that the model itself
// does not hide, in pieces of at most 40 px, less what is near a corner. An edge that differs by
// too little light, that something else covers, or that is more than 2 px away is not found, nor is
// one beside a tag: the border of its white paper would be taken for it.
std::vector<EdgePiece> find_edges(const Parts& parts, const Layout& layout, const Views& views,
                                  const Shape& shape, const ResponseCurve& response);

// Returns how far the ends of a piece are from the picture's edge now, px, across it.
glm::dvec2 edge_off(const EdgePiece& piece, const Views& views, const Shape& shape,
                    const std::vector<Solid>& solids);

}  // namespace previz::model
