// Reads numbers from JSON that may be damaged or come from elsewhere. nlohmann's own conversions
// cut what does not fit, and those of a floating-point number to a whole one may be undefined.
#pragma once

#include <concepts>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace previz::session {

// Returns the JSON as a number. Throws std::invalid_argument that names it unless it is one, a
// whole one where that is asked for, and fits.
template <typename Number, typename Json>
requires(std::floating_point<Number> ||
         (std::integral<Number> && !std::same_as<Number, bool>)) Number
    number_of(const Json& json) {
  const auto refuse = [&](const char* what) {
    throw std::invalid_argument((json.is_number() ? json.dump() : std::string(json.type_name())) +
                                what);
  };
  if constexpr (std::floating_point<Number>) {
    if (!json.is_number()) refuse(" is not a number");
  } else {
    if (!json.is_number_integer()) refuse(" is not a whole number");
    const bool fits = json.is_number_unsigned()
                          ? std::in_range<Number>(json.template get<std::uint64_t>())
                          : std::in_range<Number>(json.template get<std::int64_t>());
    if (!fits) refuse(" is too large, or below 0");
  }
  return json.template get<Number>();
}

// The same of a member; throws what Json's at() throws where it is not there.
template <typename Number, typename Json>
Number number_at(const Json& json, const char* key) {
  return number_of<Number>(json.at(key));
}

// The same, or `otherwise` where there is no such member.
template <typename Number, typename Json>
Number number_or(const Json& json, const char* key, Number otherwise) {
  return json.contains(key) ? number_of<Number>(json.at(key)) : otherwise;
}

// The same of every element of a list.
template <typename Number, typename Json>
std::vector<Number> numbers_of(const Json& json) {
  if (!json.is_array()) throw std::invalid_argument("not a list");
  std::vector<Number> numbers;
  for (const Json& number : json) numbers.push_back(number_of<Number>(number));
  return numbers;
}

}  // namespace previz::session
