// Drives cameras of the Linux kernel (V4L2): UVC cameras and capture cards, single-planar capture.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/usb/usb.hpp"
#include "drivers/v4l2/node.hpp"

namespace previz {

// `settings.device` is a name below /dev/v4l/by-id or /dev/v4l/by-path (with or without that
// directory), or the device's serial number; never /dev/videoN, whose number changes. Capture times
// are the kernel's (monotonic). The exposure is driven by V4L2_CID_EXPOSURE_ABSOLUTE; frames around
// a change, whose exposure nobody knows, are left out and counted. The gain control has no unit:
// `raw_gain` sets it, and frames report a gain of 1.
std::unique_ptr<Camera> open_v4l2(const CameraSettings& settings);

std::vector<FoundCamera> find_v4l2();

std::optional<usb::Place> usb_place_of_v4l2(const std::string& device);

// Opens the camera on a node that is open already.
std::unique_ptr<Camera> open_v4l2(std::unique_ptr<v4l2::Node> node, const CameraSettings& settings,
                                  HostClock clock = {});

}  // namespace previz
