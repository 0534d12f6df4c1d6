// The registry of camera drivers, which open cameras and list those that are there.
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
  // Returns the place of a camera on the USB, even if the camera does not answer; none if it is not
  // there.
  std::optional<usb::Place> (*usb_place)(const std::string& device) = nullptr;
};

// Returns the drivers that this build has.
std::span<const CameraDriver> camera_drivers();

// Returns the names of all drivers, including those that this build leaves out.
std::span<const char* const> camera_driver_names();

// Throws previz::Error that lists the drivers of this build if this one is not among them.
const CameraDriver& camera_driver(std::string_view name);

}  // namespace previz
