// Drives GigE Vision and USB3 Vision cameras through Aravis, which runs in a process of its own for
// each camera (receiver/main.cpp).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/usb/usb.hpp"

namespace previz {

// `settings.device` is a serial number, an Aravis device id ("Vendor-Model-Serial", or without the
// model), or the address of a network camera. Sequence numbers are the device's block ids,
// unwrapped; capture times are the device's time stamps, mapped to the host's clock
// (clock_map.hpp). If the camera can put its exposure into each frame (chunk data), frames carry
// that exposure; otherwise frames around a change are left out and counted.
//
// Opening takes ten seconds at most, every other call two. If the process ends, breaks the protocol
// or is silent for a second, the camera is lost, and its next opening starts another.
//
// Gain is driven if the camera gives it in dB (x dB is a factor of 10^(x/20)). Other scales are the
// vendor's own: asking for a gain is then an error, and frames report a gain of 1.
std::unique_ptr<Camera> open_aravis(const CameraSettings& settings);

// Searches all networks and the USB, which takes about a second.
std::vector<FoundCamera> find_aravis();

std::optional<usb::Place> usb_place_of_aravis(const std::string& device);

}  // namespace previz
