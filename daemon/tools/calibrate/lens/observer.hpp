// Fits the observer's intrinsics and Brown-Conrady distortion to views of a board.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/bundle.hpp"
#include "daemon/tools/calibrate/lens/uncertainty.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

inline constexpr std::array observer_parameters = {"fx", "fy", "cx", "cy", "k1",
                                                   "k2", "p1", "p2", "k3"};

struct ObserverFit {
  PinholeIntrinsics intrinsics;
  BundleFit fit;                        // its lens: the parameters that were fitted
  std::vector<const char*> parameters;  // their names, of observer_parameters
  std::vector<double> sigma;  // standard deviations, as observer_parameters; 0 of one left at 0
  std::vector<UncertainPixel> picture;     // on a grid over the picture
  std::vector<const char*> left_out = {};  // coefficients that the corners do not hold
  // The fit by all parameters, whichever were left out: values, and their covariance, row-major.
  // Empty after fit_observer_by_few.
  std::vector<double> whole_lens = {}, whole_covariance = {};
  double reach = 0;  // of the farthest corner from the picture's middle, in halves of the diagonal
};

// Fits both focal lengths, the principal point and k1, and those of k2, p1 with p2, and k3 that the
// corners determine: a lens with more coefficients is taken only if its Bayesian information
// criterion (Schwarz 1978) is lower. The picture must not fold within its edges, as no real lens's
// does; and none is taken that leaves the picture uncertain by more than `useless_px`, unless all
// do: it would explain corners in the middle and spoil the rest. Throws previz::Error if the views
// cannot determine a lens at all; missing_views (coverage.hpp) decides whether they determine it
// well.
ObserverFit fit_observer(const Views& views);

// Uncertainties of the projection, at worst over the picture: above the first there is a warning,
// above the second the lens is refused (coverage.hpp).
inline constexpr double doubtful_px = 1, useless_px = 5;
double worst_px(const std::vector<UncertainPixel>& picture);

// Fits one focal length and k1 alone, with the principal point in the picture's middle, as fewer
// than 5 views or views without tilt cannot tell more. The fit's lens is in the order of
// few_observer_parameters; `sigma` has both focal lengths and k1.
inline constexpr std::array few_observer_parameters = {"f", "k1"};
ObserverFit fit_observer_by_few(const Views& views);

// Returns unit vectors in camera axes for the points of a grid over the picture, but those where
// the lens folds.
std::vector<glm::dvec3> picture_rays(const PinholeIntrinsics& lens);
// Returns whether the lens folds at one of these points.
bool folds(const PinholeIntrinsics& lens);

// Convert a bundle's parameters to a lens, and project by them.
PinholeIntrinsics pinhole(std::span<const double> lens, int width, int height);
std::optional<glm::dvec2> project_pinhole(std::span<const double> lens, const glm::dvec3& point);

}  // namespace previz::calibrate
