// Measures the four corners of a tag from its four border edges, at full resolution.
#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <string>

#include "daemon/core/tracking/edge.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// The corners are lower left, lower right, upper right, upper left of the printed tag
// (libapriltag's order), at the border's edge, in pixels; (0,0) is the centre of the top-left
// pixel.
using CornerPixels = std::array<glm::dvec2, 4>;

struct RefinedCorners {
  CornerPixels pixel;
  // The row-major 8x8 covariance of (x0,y0,..,x3,y3), px^2, from the picture's own noise.
  std::array<double, 64> covariance{};
  std::string trouble;  // not empty: why there are no corners
};

// `cells` is the border's outer width in cells; `white_inside` holds for families with reversed
// borders. `guess` must be within about 2 px.
RefinedCorners refine_corners(const Luminance& luminance, const PinholeIntrinsics& lens,
                              const CornerPixels& guess, int cells, bool white_inside,
                              Fit how = Fit::exact);

// Returns the width of the narrowest cell beside the border, px: below about 2 px its edges cannot
// be separated.
double narrowest_cell_px(const CornerPixels& corners, int cells);

}  // namespace previz::tracking
