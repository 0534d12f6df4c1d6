#include "drivers/camera_drivers.hpp"

#include <array>

#include "drivers/registry.hpp"
#ifdef PREVIZ_WITH_ARAVIS
#include "drivers/aravis/aravis_camera.hpp"
#endif
#ifdef PREVIZ_WITH_LIBCAMERA
#include "drivers/libcamera/libcamera_camera.hpp"
#endif
#ifdef PREVIZ_WITH_V4L2
#include "drivers/v4l2/v4l2_camera.hpp"
#endif

namespace previz {
namespace {

constexpr auto all_camera_drivers = std::to_array<CameraDriver>({
#ifdef PREVIZ_WITH_V4L2
    {"v4l2", open_v4l2, find_v4l2, usb_place_of_v4l2},
#else
    {"v4l2"},
#endif
#ifdef PREVIZ_WITH_ARAVIS
    {"aravis", open_aravis, find_aravis, usb_place_of_aravis},
#else
    {"aravis"},
#endif
#ifdef PREVIZ_WITH_LIBCAMERA
    {"libcamera", open_libcamera, find_libcamera, usb_place_of_libcamera},
#else
    {"libcamera"},
#endif
});

}  // namespace

std::span<const CameraDriver> camera_drivers() {
  static const auto drivers = built(all_camera_drivers);
  return drivers;
}

std::span<const char* const> camera_driver_names() {
  static const auto names = names_of(all_camera_drivers);
  return names;
}

const CameraDriver& camera_driver(std::string_view name) {
  return driver_named(camera_drivers(), name, "cameras");
}

}  // namespace previz
