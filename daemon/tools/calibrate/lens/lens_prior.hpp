// Holds what the boards tell of the film camera's lens, as a prior for an adjustment that sees more
// of the picture than the boards did.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// The parameters are those of observer_parameters (observer.hpp), in their order and units.
inline constexpr int lens_size = 9;
using LensVector = cv::Vec<double, lens_size>;
using LensMatrix = cv::Matx<double, lens_size, lens_size>;

// A Gaussian over all nine parameters: the fit of the boards by all of them, whichever of them the
// printed lens keeps. It stands for the boards' corners as a whole (up to second order of their sum
// of squares), so an adjustment of tags with it is one of boards and tags together. In the part of
// the picture that the boards covered it is narrow, and beyond that it is wide, because there the
// coefficients cancel out no more. Standard deviations alone would not do: the coefficients are
// correlated to more than 0.99.
struct LensPrior {
  LensVector values;
  LensMatrix information;  // the inverse of the covariance
  // A parameter that is not free is held at the value that the start has.
  std::array<bool, lens_size> free{true, true, true, true, true, true, true, true, true};
};

LensVector lens_vector(const PinholeIntrinsics& lens);
// Returns a lens of the same picture with these parameters.
PinholeIntrinsics with_parameters(const PinholeIntrinsics& lens, const LensVector& parameters);

// Convert a fit of all parameters (its covariance positive definite) to the set file's table and
// back.
set::LensFit lens_fit_table(const LensVector& values, const LensMatrix& covariance);
LensPrior lens_prior(const set::LensFit& table);

// Returns why the table cannot be that of this lens; empty if it can: it is from a fit of another
// lens if a focal length differs by more than 2 % or the principal point by more than 2 % of the
// picture's width, or the lens has divisors, which no fit by boards gives.
std::string why_not_of(const LensPrior& prior, const PinholeIntrinsics& lens);

}  // namespace previz::calibrate
