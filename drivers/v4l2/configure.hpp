// Settles format, size, rate and controls with a video node. Not for use outside the driver.
#pragma once

#include <linux/videodev2.h>

#include <optional>
#include <string>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/convert/convert.hpp"
#include "drivers/exposure_ledger.hpp"
#include "drivers/v4l2/node.hpp"

namespace previz::v4l2 {

// The settings that the node and the driver have agreed on.
struct Agreed {
  CameraFormat format;
  convert::WireFormat wire;
  std::size_t stride = 0;       // bytes of a row; 0 for mjpeg
  std::size_t least_bytes = 0;  // of a whole picture; 0 for mjpeg, whose pictures vary
  Exposure exposure;            // 0 s if the node does not report it
  bool drives_exposure = false;
  std::vector<std::string> doubts;  // where the rate is not what was asked for
};

// Writes the settings to the node and reads back what it made of them. Throws previz::Error that
// names the device, the setting, and what the node can.
Agreed configure(Node& node, const CameraSettings& settings);

// Writes the shutter time, in the control's steps of 100 us and within its bounds. Returns what the
// node made of it; none if it refuses.
std::optional<double> set_exposure(Node& node, double exposure_s);

}  // namespace previz::v4l2
