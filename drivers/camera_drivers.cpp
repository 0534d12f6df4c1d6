#include "drivers/camera_drivers.hpp"

#include <array>

#include "drivers/error.hpp"
#ifdef PREVIZ_WITH_ARAVIS
#include "drivers/aravis/aravis_camera.hpp"
#endif

namespace previz {
namespace {

constexpr auto drivers = std::to_array<CameraDriver>({
#ifdef PREVIZ_WITH_ARAVIS
    {"aravis", open_aravis, find_aravis},
#endif
});

}  // namespace

std::span<const CameraDriver> camera_drivers() {
  return drivers;
}

const CameraDriver& camera_driver(std::string_view name) {
  std::string known;
  for (const CameraDriver& driver : drivers) {
    if (driver.name == name) return driver;
    known += known.empty() ? "" : ", ";
    known += driver.name;
  }
  throw Error("this build drives no \"" + std::string(name) + "\" cameras; it has " + known);
}

}  // namespace previz
