// Finding a driver by its name.
#pragma once

#include <string>
#include <string_view>

#include "drivers/error.hpp"

namespace previz {

// Of a list of drivers, each with a `name`. Throws previz::Error that says which this build has, if
// it has not this one; `of_what` is plural.
template <class Drivers>
const auto& driver_named(const Drivers& drivers, std::string_view name, const char* of_what) {
  std::string known;
  for (const auto& driver : drivers) {
    if (driver.name == name) return driver;
    known += known.empty() ? "" : ", ";
    known += driver.name;
  }
  throw Error("this build drives no \"" + std::string(name) + "\" " + of_what + "; it has " +
              (known.empty() ? "none" : known));
}

}  // namespace previz
