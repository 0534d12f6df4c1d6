// Reads, checks, describes and prints the values of each C++ type in a file. Nothing here knows the
// syntax of a file or the name of a key.
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace previz {

// A place in a text file. Both count from 1, as editors do; columns are code points.
struct Position {
  std::uint32_t line = 1;
  std::uint32_t column = 1;
  auto operator<=>(const Position&) const = default;
};

// The value that a file gives for a key. A date, a time or a table, which no key takes, is a
// monostate.
struct Value {
  Position at;
  std::variant<std::monostate, bool, std::int64_t, double, std::string, std::vector<Value>> data;
};

// Returns `text` with control characters as \n, \t or \u00XX.
std::string printable(const std::string& text);

// Returns printable text of at most 100 bytes, for a message: what is longer is cut in the middle,
// where "..." stands.
std::string one_line(const std::string& text);

// Thrown by Codec::read, caught where the key is known.
struct Misread {
  Position at;
  std::string what;
};

// The bounds of a number, in the unit of the file. value_in_struct = value_in_file * si.
struct Rule {
  const char* unit = "";
  double si = 1;
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_excluded = false;
  std::span<const char* const> words{};  // the texts that are allowed; empty: any text
  const char* si_unit = unit;            // the unit of the struct

  // Returns the same bounds for a file in the unit of the struct.
  constexpr Rule in_si() const {
    return {si_unit, 1, low * si, high * si, low_excluded, words, si_unit};
  }
};

// A unit that a file uses; a unit alone allows every finite number.
struct Unit : Rule {
  constexpr Unit(const char* name, double si_of_one, const char* si_name)
      : Rule{.unit = name, .si = si_of_one, .si_unit = si_name} {}
  constexpr Unit(const char* name, double si_of_one) : Unit(name, si_of_one, name) {}
  constexpr Rule within(double lowest, double highest) const {
    return {unit, si, lowest, highest, false, {}, si_unit};
  }
  constexpr Rule at_least(double lowest) const {
    return within(lowest, std::numeric_limits<double>::infinity());
  }
  constexpr Rule above(double bound,
                       double highest = std::numeric_limits<double>::infinity()) const {
    return {unit, si, bound, highest, true, {}, si_unit};
  }
};

// Structs are in metres, radians and pixels.
namespace units {
inline constexpr Unit plain{"", 1}, px{"px", 1}, m{"m", 1}, mm{"mm", 1e-3, "m"},
    deg{"degrees", std::numbers::pi / 180, "rad"};
}

// Says what a missing key means. `example` is shown in the reference.
struct Need {
  enum class Kind { defaulted, required, optional } kind = Kind::defaulted;
  std::string example;
};

// Says how files spell the values of an enumeration: `names(E)` lists them beside each E.
template <class E>
using Name = std::pair<const char*, E>;

template <class E>
constexpr const char* name_of(E value) {
  for (const auto& [name, known] : names(value))
    if (known == value) return name;
  return "(no name)";
}

// One specialisation a type:
//   read      the value, checked and in the struct's unit; throws Misread
//   print     as TOML, in the unit of the file; "" where there is nothing to print
//   describe  type, unit and range in words
template <class T>
struct Codec;

// The parts the specialisations share.
namespace codec {
double number(const Value& value, const Rule& rule);  // in the struct's unit
std::int64_t whole_number(const Value& value, const Rule& rule);
const std::string& text(const Value& value);
const std::vector<Value>& list(const Value& value, const std::string& wanted);
std::vector<double> numbers(const Value& value, std::size_t count, const Rule& rule);
std::string print_number(double file_value);  // shortest form of 12 digits, always a TOML float
std::string print_numbers(const double* values, std::size_t count, const Rule& rule);
std::string quote(const std::string& text);
std::string range(const Rule& rule);  // " in px, above 0"
[[noreturn]] void misread(const Value& value, const std::string& wanted);
}  // namespace codec

template <>
struct Codec<bool> {
  static bool read(const Value& value, const Rule&) {
    if (const auto* flag = std::get_if<bool>(&value.data)) return *flag;
    codec::misread(value, describe({}));
  }
  static std::string print(bool flag, const Rule&) { return flag ? "true" : "false"; }
  static std::string describe(const Rule&) { return "true or false"; }
};

template <std::integral T>
struct Codec<T> {
  static Rule bounded(Rule rule) {
    rule.low = std::max(rule.low, static_cast<double>(std::numeric_limits<T>::min()));
    rule.high = std::min(rule.high, static_cast<double>(std::numeric_limits<T>::max()));
    return rule;
  }
  static T read(const Value& value, const Rule& rule) {
    return static_cast<T>(codec::whole_number(value, bounded(rule)));
  }
  static std::string print(T number, const Rule&) { return std::to_string(number); }
  static std::string describe(const Rule& rule) {
    return "whole number" + codec::range(bounded(rule));
  }
};

template <>
struct Codec<double> {
  static double read(const Value& value, const Rule& rule) { return codec::number(value, rule); }
  static std::string print(double number, const Rule& rule) {
    return codec::print_number(number / rule.si);
  }
  static std::string describe(const Rule& rule) { return "number" + codec::range(rule); }
};

template <>
struct Codec<std::string> {
  static std::string read(const Value& value, const Rule& rule);
  static std::string print(const std::string& text, const Rule&) { return codec::quote(text); }
  static std::string describe(const Rule& rule);
};

template <>
struct Codec<std::filesystem::path> {
  static std::filesystem::path read(const Value& value, const Rule&);
  static std::string print(const std::filesystem::path& path, const Rule&) {
    return codec::quote(path.string());
  }
  static std::string describe(const Rule&) {
    return "path, absolute or relative to the folder of this file";
  }
};

template <class E>
requires std::is_enum_v<E>
struct Codec<E> {
  static E read(const Value& value, const Rule& rule) {
    if (const auto* text = std::get_if<std::string>(&value.data))
      for (const auto& [name, known] : names(E{}))
        if (*text == name) return known;
    codec::misread(value, describe(rule));
  }
  static std::string print(E value, const Rule&) { return codec::quote(name_of(value)); }
  static std::string describe(const Rule&) {
    std::string words;
    for (const auto& [name, known] : names(E{}))
      words += (words.empty() ? "" : " | ") + codec::quote(name);
    return words;
  }
};

// Lists of fixed length hold vectors and polynomial coefficients.
template <std::size_t N>
struct Codec<std::array<double, N>> {
  static std::array<double, N> read(const Value& value, const Rule& rule) {
    const auto numbers = codec::numbers(value, N, rule);
    std::array<double, N> out;
    std::copy_n(numbers.begin(), N, out.begin());
    return out;
  }
  static std::string print(const std::array<double, N>& numbers, const Rule& rule) {
    return codec::print_numbers(numbers.data(), N, rule);
  }
  static std::string describe(const Rule& rule) {
    return std::to_string(N) + " numbers" + codec::range(rule);
  }
};

template <>
struct Codec<glm::dvec3> {
  using Array = Codec<std::array<double, 3>>;
  static glm::dvec3 read(const Value& value, const Rule& rule) {
    const auto [x, y, z] = Array::read(value, rule);
    return {x, y, z};
  }
  static std::string print(const glm::dvec3& v, const Rule& rule) {
    return codec::print_numbers(&v.x, 3, rule);
  }
  static std::string describe(const Rule& rule) { return Array::describe(rule); }
};

// Four points, each of three numbers.
template <>
struct Codec<std::array<glm::dvec3, 4>> {
  static std::array<glm::dvec3, 4> read(const Value& value, const Rule& rule);
  static std::string describe(const Rule& rule) {
    return "4 points of 3 numbers" + codec::range(rule);
  }
};

// A 4x4 transform, row by row (or the same 16 numbers in one list); the last row is 0 0 0 1.
template <>
struct Codec<glm::dmat4> {
  static glm::dmat4 read(const Value& value, const Rule& rule);
  static std::string print(const glm::dmat4& matrix, const Rule& rule);
  static std::string describe(const Rule&) {
    return "4 rows of 4 numbers (metres), the last row 0 0 0 1";
  }
};

template <>
struct Codec<std::vector<double>> {
  static std::vector<double> read(const Value& value, const Rule& rule);
  static std::string print(const std::vector<double>& numbers, const Rule& rule) {
    return codec::print_numbers(numbers.data(), numbers.size(), rule);
  }
  static std::string describe(const Rule& rule) { return "list of numbers" + codec::range(rule); }
};

template <>
struct Codec<std::vector<std::string>> {
  static std::vector<std::string> read(const Value& value, const Rule&);
  static std::string print(const std::vector<std::string>& texts, const Rule&);
  static std::string describe(const Rule&) { return "list of texts"; }
};

// Keys that may be left out print as "" if they are.
template <class T>
struct Codec<std::optional<T>> {
  static std::optional<T> read(const Value& value, const Rule& rule) {
    return Codec<T>::read(value, rule);
  }
  static std::string print(const std::optional<T>& value, const Rule& rule) requires
      requires(const T& one) {
    Codec<T>::print(one, Rule{});
  }
  { return value ? Codec<T>::print(*value, rule) : ""; }
  static std::string describe(const Rule& rule) { return Codec<T>::describe(rule); }
};

}  // namespace previz
