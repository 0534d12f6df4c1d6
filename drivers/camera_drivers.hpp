// The registry of camera drivers: what a set asks of a camera, and who can drive it.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/camera.hpp"

namespace previz {

// What is absent is left as the device has it. What the device cannot do is an error that says what
// it can; nothing is rounded in silence but a rate or an exposure to the device's own steps.
struct CameraSettings {
  std::string source = "observer";    // becomes Frame::source
  std::string device;                 // the stable name, as `previzd devices` prints it
  std::optional<std::string> format;  // the pixel format in the driver's own words: YUYV, BayerRG12
  std::optional<int> width, height;   // pixels; both or neither
  std::optional<double> rate_hz;
  std::optional<double> exposure_s;       // shutter time; the device's automatic is then off
  std::optional<double> gain;             // linear, 1 or more
  std::optional<double> white_balance_k;  // colour temperature
  // Absent: the camera runs freely. "software": one frame a call of next(). Otherwise the hardware
  // line in the device's own words ("Line1").
  std::optional<std::string> trigger;
  std::optional<int> packet_size;  // bytes, network cameras; absent: the largest that gets through
  double responsivity = 1;         // exposure = exposure_s * gain * responsivity
};

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
