// The middle of values that may have outliers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace previz {

// Returns the middle value, or the mean of the two middle ones; there must be a value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

}  // namespace previz
