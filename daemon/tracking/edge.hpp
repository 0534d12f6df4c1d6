// One straight edge between a black and a white area, found to hundredths of a pixel.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz::tracking {

// Linear luminance of a pixel inside the picture.
using Luminance = std::function<double(int x, int y)>;

// Where an edge is thought to be. Points are on the *pinhole* plane, in pixels of the undistorted
// lens (fx x + cx, fy y + cy): there an edge that is straight in the world is straight.
struct EdgeGuess {
  glm::dvec2 a, b;                                // its ends
  glm::dvec2 bright_side;                         // a point off the line, where white is
  double dark_depth_px = 0, bright_depth_px = 0;  // how far either plain area reaches
};

struct EdgeFit {
  glm::dvec2 a, b;                          // the ends, moved onto the line
  double var_a = 0, cov_ab = 0, var_b = 0;  // of their offsets across the line, px^2
  double blur_px = 0;                       // standard deviation beyond the pixel's own box
  double contrast = 0;                      // white - black, linear
  double noise = 0;                         // rms residual, linear
};

// Fraction of a pixel on the bright side of a straight edge at signed distance `s` px (positive:
// pixel centre is on the bright side), box widths |nx|, |ny| of the edge's unit normal, blurred by
// a Gaussian. Derivatives by s and by blur where asked for.
double edge_coverage(double s, double nx, double ny, double blur_px, double* by_s = nullptr,
                     double* by_blur = nullptr);

// Fits line, blur, black, white and shading to the pixels beside the guess: robust least squares in
// linear light, where every symmetric blur leaves the edge in its place, with the sensor's
// clipping. Nothing, and `why`, if there is no such edge within about 2 px (or it is covered or
// cut).
std::optional<EdgeFit> fit_edge(const Luminance& luminance, const PinholeIntrinsics& lens,
                                const EdgeGuess& guess, const char** why);

}  // namespace previz::tracking
