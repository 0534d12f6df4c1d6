// Drives CSI cameras behind their ISP, and UVC cameras, through libcamera.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/usb/usb.hpp"

namespace previz {

// `settings.device` is libcamera's id, which says where the camera is connected. Frames carry the
// exposure that the camera reports with them; where it reports none (UVC), frames around a change
// are left out and counted. Capture times are the sensor's, on the host's clock.
std::unique_ptr<Camera> open_libcamera(const CameraSettings& settings);

std::vector<FoundCamera> find_libcamera();

std::optional<usb::Place> usb_place_of_libcamera(const std::string& device);

}  // namespace previz
