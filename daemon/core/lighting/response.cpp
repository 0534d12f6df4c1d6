#include "daemon/core/lighting/response.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include "drivers/calibration/inverse_response.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

double srgb_value(double signal) {
  return signal <= 0.0031308 ? 12.92 * signal : 1.055 * std::pow(signal, 1 / 2.4) - 0.055;
}

double table_value(const std::vector<double>& table, double signal) {
  const auto above = std::upper_bound(table.begin() + 1, table.end() - 1, signal);
  const auto below = above - 1;
  const double position = static_cast<double>(below - table.begin());
  return (position + (signal - *below) / (*above - *below)) / static_cast<double>(table.size() - 1);
}

double curve_value(const ResponseCurve& curve, double signal) {
  switch (curve.kind) {
    case ResponseCurve::Kind::srgb:
      return srgb_value(signal);
    case ResponseCurve::Kind::linear:
      return signal;
    case ResponseCurve::Kind::gamma:
      return std::pow(signal, 1 / curve.gamma);
    case ResponseCurve::Kind::table:
      return table_value(curve.inverse_table, signal);
  }
  return signal;
}

}  // namespace

Response::Response(const ResponseCurve& curve, int bits) : curve_(curve), bits_(bits) {
  if (bits < 1 || bits > 16)
    throw Error("response: samples of " + std::to_string(bits) + " bits; 1 to 16 are allowed");
  assert(curve.kind != ResponseCurve::Kind::table || curve.inverse_table.size() >= 2);
  const int max = (1 << bits) - 1;
  inverse_.resize(static_cast<std::size_t>(max) + 1);
  for (int code = 0; code <= max; ++code)
    inverse_[static_cast<std::size_t>(code)] =
        inverse_response(curve, static_cast<double>(code) / max);
  inverse_.front() = 0;
  inverse_.back() = 1;
  for (int code = 0; code <= max; ++code) {
    if (forward(inverse_[static_cast<std::size_t>(code)]) != code)
      throw Error("response: the curve is too steep or too flat for " + std::to_string(bits) +
                  "-bit samples: code " + std::to_string(code) +
                  " does not survive the round trip");
  }
}

std::uint16_t Response::forward(double signal) const {
  if (!(signal > 0)) return 0;
  const double max = static_cast<double>((1 << bits_) - 1);
  return static_cast<std::uint16_t>(
      std::floor(max * curve_value(curve_, std::min(signal, 1.0)) + 0.5));
}

float Clipping::share(std::uint32_t code) const {
  if (code < from) return 0;
  return std::min(1.0f, static_cast<float>(code - from + 1) / static_cast<float>(at - from + 1));
}

Clipping Response::clipping() const {
  constexpr double rise = 0.04;  // of the codes: ten of 8 bits
  const double max = static_cast<double>((1 << bits_) - 1);
  const auto code = [&](double share) {
    return static_cast<std::uint32_t>(std::ceil(max * std::max(share, 0.0)));
  };
  return {std::max(code(curve_.clip_share - rise), 1u), std::max(code(curve_.clip_share), 1u)};
}

double Response::least_signal(std::uint16_t code) const {
  if (code == 0) return 0;
  const double max = static_cast<double>((1 << bits_) - 1);
  return inverse_response(curve_, (static_cast<double>(code) - 0.5) / max);
}

}  // namespace previz::lighting
