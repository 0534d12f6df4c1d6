// The observer's intrinsics and Brown-Conrady distortion from views of a board.
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
  std::vector<UncertainPixel> picture;  // on a grid over it
};

// k3 is fitted only where the corners ask for it (Bayesian information criterion, Schwarz 1978).
// Throws previz::Error if the views cannot determine a lens at all; whether they do it well is for
// missing_views (coverage.hpp) to say.
ObserverFit fit_observer(const Views& views);

// The lens as a bundle's parameters, and back.
PinholeIntrinsics pinhole(std::span<const double> lens, int width, int height);
std::optional<glm::dvec2> project_pinhole(std::span<const double> lens, const glm::dvec3& point);

}  // namespace previz::calibrate
