// Draws a calibration: every corner's residual, and how certain the lens is across the picture.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/bundle.hpp"
#include "daemon/tools/calibrate/lens/uncertainty.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"

namespace previz::calibrate {

// Returns an SVG. Over the picture's area it has the residuals of all views as lines from the
// corner, enlarged (the scale is stated), left-out corners in red; under them the projection's
// standard deviation as shades; below, each view's rms.
std::string residual_plot_svg(const Views& views, const BundleFit& fit,
                              const std::vector<UncertainPixel>& picture, const std::string& title);

// Returns the rms distance of a view's used corners, px; 0 if none is used.
double view_rms_px(const BundleFit& fit, std::size_t view);

}  // namespace previz::calibrate
