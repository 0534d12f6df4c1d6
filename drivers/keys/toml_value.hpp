// Converts the nodes of a TOML file to Values.
#pragma once

#include <toml++/toml.h>

#include "drivers/keys/value.hpp"

namespace previz {

Position position(const toml::source_region& region);
Value value_of(const toml::node& node);

}  // namespace previz
