// Measures one straight edge between a black and a white area to hundredths of a pixel.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz::tracking {

// Returns the linear luminance of a pixel inside the picture.
using Luminance = std::function<double(int x, int y)>;

// A guess at where an edge is. Points are on the *pinhole* plane, in pixels of the undistorted lens
// (fx x + cx, fy y + cy), where an edge that is straight in the world is straight.
struct EdgeGuess {
  glm::dvec2 a, b;                                // the edge's ends
  glm::dvec2 bright_side;                         // a point off the line, where white is
  double dark_depth_px = 0, bright_depth_px = 0;  // how far either plain area reaches
};

struct EdgeFit {
  glm::dvec2 a, b;                          // the ends, moved onto the line
  double var_a = 0, cov_ab = 0, var_b = 0;  // of the ends' offsets across the line, px^2
  double blur_px = 0;                       // standard deviation beyond the pixel's own box
  double contrast = 0;                      // white - black, linear
  double noise = 0;                         // rms residual, linear
};

// How an edge is fitted. Quick fits read the normal distribution of the blur from a table, within
// 2e-10, and use a quarter of a long edge until the last round; their corners are those of exact
// fits within 0.02 px.
enum class Fit { exact, quick };

// Returns the fraction of a pixel that is on the bright side of a straight edge at signed distance
// `s` px (positive: the pixel's centre is on the bright side), where |nx|, |ny| are the box widths
// of the edge's unit normal and a Gaussian blurs the edge. Writes the derivatives by s and by blur
// where they are asked for.
double edge_coverage(double s, double nx, double ny, double blur_px, double* by_s = nullptr,
                     double* by_blur = nullptr, Fit how = Fit::exact);

// Fits line, blur, black, white and shading to the pixels beside the guess: robust least squares in
// linear light, where every symmetric blur leaves the edge in its place, with the sensor's
// clipping. Returns nothing, and the reason in `why`, if there is no such edge within about 2 px
// (or it is covered or cut).
std::optional<EdgeFit> fit_edge(const Luminance& luminance, const PinholeIntrinsics& lens,
                                const EdgeGuess& guess, const char** why, Fit how = Fit::exact);

}  // namespace previz::tracking
