// Units that tests write their figures in.
#pragma once

#include <numbers>

namespace previz::test {

inline constexpr double degree = std::numbers::pi / 180;  // rad

}  // namespace previz::test
