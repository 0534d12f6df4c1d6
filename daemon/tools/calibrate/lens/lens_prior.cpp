#include "daemon/tools/calibrate/lens/lens_prior.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "daemon/tools/calibrate/lens/observer.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {

static_assert(observer_parameters.size() == std::size_t{lens_size});

LensVector lens_vector(const PinholeIntrinsics& lens) {
  return {lens.fx, lens.fy, lens.cx, lens.cy, lens.k1, lens.k2, lens.p1, lens.p2, lens.k3};
}

PinholeIntrinsics with_parameters(const PinholeIntrinsics& lens, const LensVector& parameters) {
  PinholeIntrinsics result = pinhole({parameters.val, lens_size}, lens.width, lens.height);
  result.k4 = lens.k4, result.k5 = lens.k5, result.k6 = lens.k6;
  return result;
}

set::LensFit lens_fit_table(const LensVector& values, const LensMatrix& covariance) {
  set::LensFit table;
  table.values.assign(values.val, values.val + lens_size);
  // Cholesky's factor L of covariance = L L^T, row by row. Its digits keep the covariance positive
  // definite when they are rounded; those of the covariance would not.
  LensMatrix root = LensMatrix::zeros();
  for (int r = 0; r < lens_size; ++r)
    for (int c = 0; c <= r; ++c) {
      double rest = covariance(r, c);
      for (int k = 0; k < c; ++k) rest -= root(r, k) * root(c, k);
      root(r, c) = r == c ? std::sqrt(rest) : rest / root(c, c);
      if (!std::isfinite(root(r, c)) || (r == c && !(rest > 0)))
        throw Error("the views do not determine all coefficients of the lens together");
      table.covariance_root.push_back(root(r, c));
    }
  return table;
}

LensPrior lens_prior(const set::LensFit& table) {
  LensPrior prior;
  std::ranges::copy(table.values, prior.values.val);
  LensMatrix root = LensMatrix::zeros();
  std::size_t next = 0;
  for (int r = 0; r < lens_size; ++r)
    for (int c = 0; c <= r; ++c) root(r, c) = table.covariance_root[next++];
  const LensMatrix whitening = root.solve(LensMatrix::eye(), cv::DECOMP_LU);
  prior.information = whitening.t() * whitening;
  return prior;
}

std::string why_not_of(const LensPrior& prior, const PinholeIntrinsics& lens) {
  constexpr double largest = 0.02;
  if (lens.k4 != 0 || lens.k5 != 0 || lens.k6 != 0) return "the lens has k4, k5 or k6";
  const LensVector now = lens_vector(lens);
  for (int p = 0; p < 4; ++p) {
    const double unit = p < 2 ? now[p] : lens.width;
    if (!(std::abs(prior.values[p] - now[p]) <= largest * unit))
      return std::string("their ") + observer_parameters[std::size_t(p)] +
             " differ by more than 2 %";
  }
  return "";
}

}  // namespace previz::calibrate
