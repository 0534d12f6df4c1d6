#include "daemon/tools/calibrate/lens/length.hpp"

#include <charconv>

namespace previz::calibrate {

std::optional<double> parse_length(std::string_view text) {
  constexpr struct {
    std::string_view unit;
    double metres;
  } units[] = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"in", 0.0254}};
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  if (read.ec != std::errc{}) return std::nullopt;
  for (const auto& [unit, metres] : units)
    if (std::string_view(read.ptr, std::size_t(end - read.ptr)) == unit && number > 0 &&
        number * metres < 100)
      return number * metres;
  return std::nullopt;
}

}  // namespace previz::calibrate
