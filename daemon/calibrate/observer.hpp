// Fits the observer's intrinsics and Brown-Conrady distortion to views of a board.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/calibrate/bundle.hpp"
#include "daemon/calibrate/uncertainty.hpp"
#include "daemon/calibrate/views.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

inline constexpr std::array observer_parameters = {"fx", "fy", "cx", "cy", "k1",
                                                   "k2", "p1", "p2", "k3"};

struct ObserverFit {
  PinholeIntrinsics intrinsics;
  BundleFit fit;                        // lens in the order of observer_parameters
  std::vector<double> sigma;            // standard deviations, in that order; 0 for k3 left at 0
  std::vector<UncertainPixel> picture;  // on a grid over the picture
};

// k3 is fitted only if the corners justify it (Bayesian information criterion, Schwarz 1978).
// Throws previz::Error if the views cannot determine a lens at all; missing_views (coverage.hpp)
// decides whether they determine it well.
ObserverFit fit_observer(const Views& views);

// Fits one focal length and k1 alone, with the principal point in the picture's middle, as fewer
// than 5 views or views without tilt cannot tell more. The fit's lens is in the order of
// few_observer_parameters; `sigma` has both focal lengths and k1.
inline constexpr std::array few_observer_parameters = {"f", "k1"};
ObserverFit fit_observer_by_few(const Views& views);

// Convert a bundle's parameters to a lens, and project by them.
PinholeIntrinsics pinhole(std::span<const double> lens, int width, int height);
std::optional<glm::dvec2> project_pinhole(std::span<const double> lens, const glm::dvec3& point);

}  // namespace previz::calibrate
