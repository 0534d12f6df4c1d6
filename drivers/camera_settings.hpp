// The settings that a set asks of a camera, as plain data.
#pragma once

#include <optional>
#include <string>

namespace previz {

// An absent setting stays as the device has it. A setting that the device cannot do is an error
// that says what it can do; only a rate or an exposure is silently rounded, to the device's own
// steps. A rate farther off is an error as well, or a doubt of the camera (frame_rate.hpp).
struct CameraSettings {
  std::string source = "observer";    // becomes Frame::source
  std::string device;                 // the stable name, as `previzd devices` prints it
  std::optional<std::string> format;  // the pixel format in the driver's own words: YUYV, BayerRG12
  std::optional<int> width, height;   // pixels; both or neither
  std::optional<double> rate_hz;
  std::optional<double> exposure_s;       // shutter time; the device's automatic is then off
  std::optional<double> gain;             // linear, of a device whose gain is in dB
  std::optional<double> raw_gain;         // in the device's own units; its factor is then not known
  std::optional<double> white_balance_k;  // colour temperature
  // Absent: the camera runs freely. "software": each call of next() triggers one frame. Otherwise:
  // the hardware line in the device's own words ("Line1").
  std::optional<std::string> trigger;
  std::optional<int> packet_size;  // bytes, network cameras; absent: the largest that gets through
  double responsivity = 1;         // exposure = exposure_s * gain * responsivity
};

}  // namespace previz
