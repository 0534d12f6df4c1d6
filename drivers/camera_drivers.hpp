// The registry of camera drivers: who can open which camera, and which are there.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/usb/usb.hpp"

namespace previz {

struct CameraDriver {
  std::string_view name;
  // Throws previz::Error that names the device and says what is wrong.
  std::unique_ptr<Camera> (*open)(const CameraSettings& settings);
  std::vector<FoundCamera> (*find)();
  // Where on the USB a camera is, also one that does not answer; none where it is not there.
  std::optional<usb::Place> (*usb_place)(const std::string& device);
};

// Those this build has.
std::span<const CameraDriver> camera_drivers();

// Throws previz::Error that says which drivers this build has, if it has not this one.
const CameraDriver& camera_driver(std::string_view name);

}  // namespace previz
