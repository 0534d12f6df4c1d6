#include "drivers/display.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace previz {
namespace {

constexpr int largest_side_px = 16384;
constexpr double highest_rate_hz = 1000;

// Reads a number and the character that follows it; false if the text does not begin with one.
template <class Number>
bool take_number(std::string_view& text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool take(std::string_view& text, char expected) {
  if (!text.starts_with(expected)) return false;
  text.remove_prefix(1);
  return true;
}

}  // namespace

std::optional<DisplayMode> parse_display_mode(std::string_view text) {
  DisplayMode mode;
  if (!take_number(text, mode.width) || !take(text, 'x') || !take_number(text, mode.height))
    return std::nullopt;
  if (std::min(mode.width, mode.height) < 1 || std::max(mode.width, mode.height) > largest_side_px)
    return std::nullopt;
  if (text.empty()) return mode;
  if (!take(text, '@') || !take_number(text, mode.rate_hz) || !text.empty()) return std::nullopt;
  if (!(mode.rate_hz > 0 && mode.rate_hz <= highest_rate_hz)) return std::nullopt;
  return mode;
}

std::string to_string(const DisplayMode& mode) {
  std::string text = std::to_string(mode.width) + "x" + std::to_string(mode.height);
  if (mode.rate_hz > 0) {
    char rate[32];
    std::snprintf(rate, sizeof rate, "@%.6g", std::round(mode.rate_hz * 100) / 100);
    text += rate;
  }
  return text;
}

}  // namespace previz
