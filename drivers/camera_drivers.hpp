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
#include "drivers/exposure_ledger.hpp"
#include "drivers/usb/usb.hpp"

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
  // Where on the USB a camera is, also one that does not answer; none where it is not there.
  std::optional<usb::Place> (*usb_place)(const std::string& device);
};

// Those this build has.
std::span<const CameraDriver> camera_drivers();

// Throws previz::Error that says which drivers this build has, if it has not this one.
const CameraDriver& camera_driver(std::string_view name);

// What a frame was taken with. A shutter time that is not known (0) counts as 1 s.
inline void tell_exposure(Frame& frame, const Exposure& exposure, double responsivity) {
  frame.exposure_s = exposure.exposure_s;
  frame.gain = exposure.gain;
  frame.exposure =
      (exposure.exposure_s > 0 ? exposure.exposure_s : 1.0) * exposure.gain * responsivity;
}

}  // namespace previz
