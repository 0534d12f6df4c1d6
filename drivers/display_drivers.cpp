#include "drivers/display_drivers.hpp"

#include <algorithm>
#include <array>

#include "drivers/headless/headless_display.hpp"
#ifdef PREVIZ_WITH_KMS
#include "drivers/kms/kms_display.hpp"
#endif
#include "drivers/registry.hpp"

namespace previz {
namespace {

constexpr auto all_display_drivers = std::to_array<DisplayDriver>({
#ifdef PREVIZ_WITH_KMS
    {"kms", true, open_kms, find_kms},
#else
    {"kms", true},
#endif
    {"headless", false, open_headless, find_headless},
});

}  // namespace

std::span<const DisplayDriver> display_drivers() {
  static const auto drivers = built(all_display_drivers);
  return drivers;
}

std::span<const char* const> display_driver_names() {
  static const auto names = names_of(all_display_drivers);
  return names;
}

bool drives_connectors(std::string_view name) {
  return std::ranges::any_of(all_display_drivers, [name](const DisplayDriver& driver) {
    return name == driver.name && driver.drives_connectors;
  });
}

const DisplayDriver& display_driver(std::string_view name) {
  return driver_named(display_drivers(), name, "displays");
}

}  // namespace previz
