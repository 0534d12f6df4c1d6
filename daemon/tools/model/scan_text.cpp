#include "daemon/tools/model/scan_text.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>

#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

constexpr std::string_view white = " \t\v\f\r\n";

}  // namespace

std::string scan_bytes(const std::filesystem::path& file) {
  const auto memory = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                      static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  const std::uint64_t most_bytes = std::min(std::uint64_t{1} << 34, memory / 2);
  return session::read_file(file, {"a scan on this machine", most_bytes});
}

std::string_view next_line(std::string_view& text) {
  const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
  const std::string_view line = text.substr(0, end);
  const std::size_t skipped = text.substr(end).starts_with("\r\n") ? 2 : 1;
  text.remove_prefix(std::min(end + skipped, text.size()));
  return line;
}

std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(white), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(white));
  line.remove_prefix(word.size());
  return word;
}

std::string_view trimmed(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(white), line.size()));
  return line.substr(0, line.find_last_not_of(white) + 1);
}

std::string_view without_quotes(std::string_view name) {
  name = trimmed(name);
  const bool is_quoted = name.size() > 1 && name.starts_with('"') && name.ends_with('"');
  return is_quoted ? name.substr(1, name.size() - 2) : name;
}

std::optional<double> number_in(std::string_view word) {
  std::array<char, 64> with_point{};
  if (const std::size_t comma = word.find(','); comma < word.size() && word.size() < 64) {
    std::ranges::copy(word, with_point.begin());
    with_point[comma] = '.';
    word = {with_point.data(), word.size()};
  }
  if (word.starts_with('+')) word.remove_prefix(1);
  if (word.find(".#") != std::string_view::npos) return std::numeric_limits<double>::quiet_NaN();
  double number = 0;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), number);
  if (read.ec == std::errc::result_out_of_range)
    return word.find_first_of("eE") != std::string_view::npos &&
                   word.find("e-") == std::string_view::npos &&
                   word.find("E-") == std::string_view::npos
               ? std::numeric_limits<double>::infinity()
               : 0.0;
  if (read.ec != std::errc()) return {};
  return number;
}

void TextSteps::add(std::size_t axis, double value, std::string_view word) {
  const std::size_t point = word.find_first_of(".,"), exponent = word.find_first_of("eE");
  int last_digit = 0;  // the power of ten of the last digit
  if (point < word.size())
    last_digit = -static_cast<int>(std::min(exponent, word.size()) - point - 1);
  if (exponent < word.size()) {
    const char* const from =
        word.data() + exponent + (word.substr(exponent + 1).starts_with('+') ? 2 : 1);
    int power = 0;
    std::from_chars(from, word.data() + word.size(), power);
    last_digit += std::clamp(power, -300, 300);
  }
  Axis& a = axes_.at(axis);
  a.finest = std::min(a.finest, std::pow(10.0, last_digit));
  if (!std::isfinite(value)) return;
  a.low = std::min(a.low, value);
  a.high = std::max(a.high, value);
}

double TextSteps::step() const {
  constexpr double far = 16;  // extents
  double coarsest = 0;
  for (const Axis& a : axes_) {
    const double farthest = std::max(std::abs(a.low), std::abs(a.high));
    if (a.high > a.low && farthest > far * (a.high - a.low))
      coarsest = std::max(coarsest, a.finest);
  }
  return coarsest;
}

}  // namespace previz::model
