#include "drivers/calibration/inverse_response.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace previz {
namespace {

double table_signal(const std::vector<double>& table, double value) {
  assert(table.size() >= 2);
  const double position = value * static_cast<double>(table.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(position), table.size() - 2);
  const double t = position - static_cast<double>(below);
  return (1 - t) * table[below] + t * table[below + 1];
}

}  // namespace

double inverse_response(const ResponseCurve& curve, double value) {
  value = std::clamp(value, 0.0, 1.0);
  switch (curve.kind) {
    case ResponseCurve::Kind::srgb:
      return srgb_signal(value);
    case ResponseCurve::Kind::linear:
      return value;
    case ResponseCurve::Kind::gamma:
      return std::pow(value, curve.gamma);
    case ResponseCurve::Kind::table:
      return table_signal(curve.inverse_table, value);
  }
  return value;
}

}  // namespace previz
