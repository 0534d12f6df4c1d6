#include "daemon/core/session/nominal_rate.hpp"

extern "C" {
#include <libavutil/rational.h>
}

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace previz::session {
namespace {

constexpr double fallback_fps = 25;
// 29.97 and 30 are 1e-3 apart, and the quartz clocks of cameras within 1e-4 of what they say.
constexpr double clock_error = 4e-4;
constexpr double most_standard_fps = 1000;
constexpr double ntsc = 1000.0 / 1001;
constexpr std::size_t gaps_named = 3;
constexpr double most_missing = 9e18;  // in one gap; more is no 64-bit number
// People write 23.976024 as 23.98, and no other of these rates farther from what it is.
constexpr double written_error_fps = 5e-3, written_error = written_error_fps / 24;
constexpr double most_int = std::numeric_limits<int>::max();

double nearest_standard(double fps) {
  const double whole = std::clamp(std::round(fps), 1.0, most_standard_fps);
  double nearest = whole;
  for (const double rate : {24.0, 30.0, 48.0, 60.0, 120.0, 240.0})
    if (std::abs(rate * ntsc - fps) < std::abs(nearest - fps)) nearest = rate * ntsc;
  return nearest;
}

std::vector<double> differences(std::span<const std::int64_t> times) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i)
    steps.push_back(static_cast<double>(times[i] - times[i - 1]));
  return steps;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

NominalRate nominal_rate(std::span<const std::int64_t> times_ns) {
  const std::vector<double> steps = differences(times_ns);
  if (steps.empty()) return {};
  const double usual = median(steps);
  if (!(usual > 0)) return {};
  NominalRate rate;
  double frames = 0, worst = 0;
  std::size_t off = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double count = std::max(1.0, std::round(steps[i] / usual));
    frames += count;
    if (std::abs(steps[i] / usual - count) > 0.25) ++off;
    worst = std::max(worst, std::abs(steps[i] - count * usual));
    if (count > 1)
      rate.gaps.push_back({i, static_cast<std::int64_t>(std::min(count, most_missing)) - 1});
  }
  const auto time = static_cast<double>(times_ns.back() - times_ns.front());
  rate.varies = 10 * off > steps.size();
  // Of times that vary the usual one is what the camera was set to.
  const double fps = rate.varies ? 1e9 / usual : frames * 1e9 / time;
  // The first and the last time may each be wrong by as much as a step was.
  const double error = clock_error + (rate.varies ? 0.02 : 2 * worst / time);
  const double standard = nearest_standard(fps);
  rate.is_standard = std::abs(standard - fps) <= error * fps;
  rate.fps = rate.is_standard ? standard : fps;
  if (rate.varies) rate.gaps.clear();
  return rate;
}

RateFraction fraction_of(double given_fps) {
  const double fps = std::clamp(given_fps, 1 / most_int, most_int);
  const double rounded = std::round(fps);
  if (rounded > 0 && std::abs(fps - rounded) < 1e-9) return {static_cast<int>(rounded), 1};
  const double up = std::round(fps / ntsc);
  if (up * 1000 <= most_int &&
      std::abs(fps - up * ntsc) < std::min(written_error_fps, written_error * fps))
    return {static_cast<int>(up) * 1000, 1001};
  if (fps >= 1 && fps * 1000 < most_int) return {static_cast<int>(std::lround(fps * 1000)), 1000};
  const AVRational nearest = av_d2q(fps, std::numeric_limits<int>::max());
  return {nearest.num, nearest.den};
}

std::string words_of(const NominalRate& rate) {
  std::string text = fmt::format("{:.6g} frames per second", std::round(rate.fps * 1000) / 1000);
  if (!rate.is_standard) text += ", which is not a usual rate";
  if (rate.varies) text += ", varying; it is the most common";
  std::int64_t missing = 0;
  for (const RateGap& gap : rate.gaps) missing += gap.frames;
  if (missing == 0) return text;
  text += fmt::format("; {} missing", missing == 1 ? "1 frame is" : fmt::format("{} are", missing));
  for (std::size_t i = 0; i < std::min(rate.gaps.size(), gaps_named); ++i)
    text += fmt::format("{} after frame {}", i == 0 ? "," : " and", rate.gaps[i].after);
  if (rate.gaps.size() > gaps_named) text += " and elsewhere";
  return text;
}

}  // namespace previz::session
