// The nodes of a TOML file as Values.
#pragma once

#include <toml++/toml.h>

#include "drivers/keys/value.hpp"

namespace previz {

Position position(const toml::source_region& region);
Value value_of(const toml::node& node);

}  // namespace previz
