// Prints the reference of the set file.
#pragma once

#include <string>

namespace previz::set {

// Returns the text of config/reference.toml: every key with its unit, default and range, from the
// parser's own table.
std::string reference_toml();

}  // namespace previz::set
