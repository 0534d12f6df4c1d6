#pragma once

#include <cstddef>

namespace previz::output {

// No picture of more pixels is read: a small file can claim to hold any number.
inline constexpr std::size_t most_pixels = std::size_t{1} << 28;

}  // namespace previz::output
