// Reads lengths as a command line writes them.
#pragma once

#include <optional>
#include <string_view>

namespace previz::calibrate {

// Returns the metres of a length in mm, cm, m or in (inches), above 0 and below 100 m; nothing if
// it cannot be understood.
std::optional<double> parse_length(std::string_view text);

}  // namespace previz::calibrate
