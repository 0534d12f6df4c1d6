// Makes letters small, as in names and words of files: A to Z alone, whatever the locale.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace previz {

constexpr char lower_case(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

inline std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](char c) { return lower_case(c); });
  return lower;
}

}  // namespace previz
