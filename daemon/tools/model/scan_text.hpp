// Takes the files of scans apart into lines, words and numbers.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace previz::model {

// Returns all bytes of a scan's file. Throws previz::Error naming the file if it cannot be read or
// is larger than 16 GiB or half of the memory.
std::string scan_bytes(const std::filesystem::path& file);

// Takes the first line off a text and returns it without its end, which is that of Unix, Windows or
// the old Macintosh.
std::string_view next_line(std::string_view& text);

// Takes the first word off a line and returns it; it is empty if there is none.
std::string_view next_word(std::string_view& line);

// Returns a line without white space at its ends.
std::string_view trimmed(std::string_view line);

// Returns a trimmed name without the quotation marks that some programs put around it.
std::string_view without_quotes(std::string_view name);

// Returns the number that a word begins with, whose decimal sign may be a comma; what is written
// for infinity and for what is not a number, 1.#IND for example, is not finite. Returns nothing
// for other words.
std::optional<double> number_in(std::string_view word);

// Returns the number of type T whose bytes begin here, in this machine's order or the other one.
template <typename T>
double binary_number(const char* bytes, bool is_swapped = false) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), bytes, sizeof(T));
  if (is_swapped) std::ranges::reverse(raw);
  return static_cast<double>(std::bit_cast<T>(raw));
}

// The steps of coordinates that are written with few digits.
class TextSteps {
 public:
  // Adds a coordinate along axis 0, 1 or 2 as it is written.
  void add(std::size_t axis, double value, std::string_view word);

  // Returns the finest step along the axis where it is coarsest, of those along which the scan is
  // far from the origin: on others few digits mean little. 0 if there is none.
  double step() const;

 private:
  struct Axis {
    double finest = std::numeric_limits<double>::infinity();
    double low = std::numeric_limits<double>::infinity(), high = -low;
  };
  std::array<Axis, 3> axes_;
};

}  // namespace previz::model
