#include "drivers/display_drivers.hpp"

#include <array>

#include "drivers/headless/headless_display.hpp"
#ifdef PREVIZ_WITH_KMS
#include "drivers/kms/kms_display.hpp"
#endif
#include "drivers/registry.hpp"

namespace previz {
namespace {

constexpr auto drivers_of_displays = std::to_array<DisplayDriver>({
#ifdef PREVIZ_WITH_KMS
    {"kms", open_kms, find_kms},
#endif
    {"headless", open_headless, find_headless},
});

}  // namespace

std::span<const DisplayDriver> display_drivers() {
  return drivers_of_displays;
}

const DisplayDriver& display_driver(std::string_view name) {
  return driver_named(drivers_of_displays, name, "displays");
}

}  // namespace previz
