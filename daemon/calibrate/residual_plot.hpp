// A calibration as a picture: every corner's residual, and how certain the lens is where.
#pragma once

#include <string>
#include <vector>

#include "daemon/calibrate/bundle.hpp"
#include "daemon/calibrate/uncertainty.hpp"
#include "daemon/calibrate/views.hpp"

namespace previz::calibrate {

// An SVG: over the picture's area the residuals of all views as lines from the corner, enlarged
// (the scale is stated), those left out in red; under them the projection's standard deviation as
// shades; below, each view's rms.
std::string residual_plot_svg(const Views& views, const BundleFit& fit,
                              const std::vector<UncertainPixel>& picture, const std::string& title);

// Rms distance of a view's used corners, px; 0 where none is used.
double view_rms_px(const BundleFit& fit, std::size_t view);

}  // namespace previz::calibrate
