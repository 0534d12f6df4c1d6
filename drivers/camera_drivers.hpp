// The registry of camera drivers: who can open which camera, and which are there.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"

namespace previz {

// A camera that is there now.
struct FoundCamera {
  std::string driver;       // as in the set file
  std::string device;       // its stable name
  std::string description;  // vendor, model, where it is plugged in
};

struct CameraDriver {
  std::string_view name;
  // Throws previz::Error that names the device and says what is wrong.
  std::unique_ptr<Camera> (*open)(const CameraSettings& settings);
  std::vector<FoundCamera> (*find)();
};

// Those this build has.
std::span<const CameraDriver> camera_drivers();

// Throws previz::Error that says which drivers this build has, if it has not this one.
const CameraDriver& camera_driver(std::string_view name);

// The absolute exposure of a frame. A shutter time that is not known (0) counts as 1 s.
inline double absolute_exposure(double exposure_s, double gain, double responsivity) {
  return (exposure_s > 0 ? exposure_s : 1.0) * gain * responsivity;
}

}  // namespace previz
