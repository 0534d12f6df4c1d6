// Helps with lists of drivers. A build that leaves a driver out still lists it, but without `open`,
// so that every build reads every set.
#pragma once

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/error.hpp"

namespace previz {

// Returns the drivers of a list that this build has.
template <class Drivers>
auto built(const Drivers& all) {
  std::vector<typename Drivers::value_type> drivers;
  std::ranges::copy_if(all, std::back_inserter(drivers),
                       [](const auto& driver) { return driver.open != nullptr; });
  return drivers;
}

// Returns the names of all drivers of a list.
template <class Drivers>
std::vector<const char*> names_of(const Drivers& all) {
  std::vector<const char*> names;
  for (const auto& driver : all) names.push_back(driver.name);
  return names;
}

// Finds a driver by its name in a list of those this build has. Throws previz::Error that names
// them if the driver is not among them; `of_what` is their kind, in the plural.
template <class Drivers>
const auto& driver_named(const Drivers& drivers, std::string_view name, const char* of_what) {
  std::string known;
  for (const auto& driver : drivers) {
    if (name == driver.name) return driver;
    add_to_list(known, driver.name);
  }
  throw Error("this build supports no \"" + std::string(name) + "\" " + of_what +
              "; supported: " + (known.empty() ? "none" : known));
}

}  // namespace previz
