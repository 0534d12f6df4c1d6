// Compares the frame rate that a set asks for with the rates that a device offers, and words the
// difference in one way for every driver.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera_settings.hpp"
#include "drivers/error.hpp"

namespace previz {

// The rates, in frames per second, that a device offers for the picture it is set to.
struct RatesOnOffer {
  std::vector<double> hz;    // empty: the device does not report any
  bool all_between = false;  // `hz` is the least and the greatest, and others lie between
};

// Returns the rates from one to the other; none if these are no bounds, as a faulty device may
// report them: not a number, infinite, below 0, or the greatest below the least.
inline RatesOnOffer rates_between(double least_hz, double most_hz) {
  if (!(least_hz >= 0 && least_hz <= most_hz && std::isfinite(most_hz))) return {};
  return {{least_hz, most_hz}, true};
}

// A hundredth: the steps of a device round a rate, and a name rounds it as well ("30" for 29.97).
inline bool is_same_rate(double asked_hz, double other_hz) {
  return std::abs(other_hz - asked_hz) <= 0.01 * asked_hz;
}

// Returns the rate on offer that is nearest to the one asked for; the latter if no rate is known.
inline double nearest_rate(const RatesOnOffer& offer, double asked_hz) {
  if (offer.hz.empty()) return asked_hz;
  if (offer.all_between) return std::clamp(asked_hz, offer.hz.front(), offer.hz.back());
  return *std::ranges::min_element(offer.hz, {},
                                   [&](double rate_hz) { return std::abs(rate_hz - asked_hz); });
}

inline std::string text_of_rate(double rate_hz) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.5g", rate_hz);
  return text.data();
}

// Returns "30, 15" or "1 to 60"; empty if no rate is known.
inline std::string text_of(const RatesOnOffer& offer) {
  if (offer.all_between)
    return text_of_rate(offer.hz.front()) + " to " + text_of_rate(offer.hz.back());
  std::string text;
  for (const double rate_hz : offer.hz) add_to_list(text, text_of_rate(rate_hz));
  return text;
}

// Returns why the rate of a set is not used, which rates there are, and what to do. `instead_hz` is
// the rate that the camera has instead; none if it was refused. `allowed` lists the rates on offer,
// as text_of() or with what each of them needs; empty if they are unknown.
inline std::string rate_not_possible(double asked_hz, std::optional<double> instead_hz,
                                     const std::string& allowed) {
  std::string text = "rate_hz " + text_of_rate(asked_hz) + " is not possible";
  if (instead_hz) text += "; the camera sends " + text_of_rate(*instead_hz) + " frames per second";
  if (!allowed.empty()) text += "; allowed: " + allowed;
  return text + "; change rate_hz or remove it";
}

// Returns that a device sends another rate than it was asked for, in the words of
// rate_not_possible(); nothing if it does not, or if either rate is not known.
inline std::optional<std::string> other_rate(const CameraSettings& asked, double granted_hz,
                                             const std::string& allowed) {
  if (!asked.rate_hz || !(granted_hz > 0) || is_same_rate(*asked.rate_hz, granted_hz))
    return std::nullopt;
  return rate_not_possible(*asked.rate_hz, granted_hz, allowed);
}

}  // namespace previz
