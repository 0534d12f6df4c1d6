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
  const char* name;  // as a set file writes it
  // Throws previz::Error that names the device and says what is wrong.
  std::unique_ptr<Camera> (*open)(const CameraSettings& settings) = nullptr;
  std::vector<FoundCamera> (*find)() = nullptr;
  // Where on the USB a camera is, also one that does not answer; none where it is not there.
  std::optional<usb::Place> (*usb_place)(const std::string& device) = nullptr;
};

// The drivers that this build has.
std::span<const CameraDriver> camera_drivers();

// The names of all drivers, also of those that this build leaves out.
std::span<const char* const> camera_driver_names();

// Throws previz::Error that says which drivers this build has, if it has not this one.
const CameraDriver& camera_driver(std::string_view name);

}  // namespace previz
