// Reads a TOML file by tables of keys (daemon/core/set/table.hpp), and says what in it is not one
// of them.
#pragma once

#include <toml++/toml.h>

#include <functional>
#include <string>
#include <vector>

#include "daemon/core/set/problems.hpp"
#include "daemon/core/set/table.hpp"

namespace previz::set {

// Returns the header of the table that has such a key, "[quality]" or "[[tag]]"; "" if none has.
using Homes = std::function<std::string(const std::string& key)>;
// Looks among these sections, each of which is opened for it.
std::string home_among(const std::vector<Section>& sections, const std::string& key);

// Parses TOML text; throws previz::Error naming file and line if it is none, or if a table of these
// sections has the other kind of brackets.
toml::table parse_toml(const std::string& text, const std::string& file,
                       const std::vector<Section>& sections, Problems& problems);

// Reads the whole file into what the sections are bound to. An unknown key, a value that is not
// allowed and a required key that is missing become problems, each with what is allowed in its
// place; `home_of` says of an unknown key where it belongs.
void read_tables(const toml::table& root, const std::vector<Section>& sections,
                 const Homes& home_of, Problems& problems);

}  // namespace previz::set
