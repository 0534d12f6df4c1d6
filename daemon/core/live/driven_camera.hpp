// Opens a camera as a set describes it, and keeps it alive through losses.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "drivers/camera.hpp"
#include "drivers/faults.hpp"
#include "drivers/lifeline.hpp"
#include "drivers/usb/usb.hpp"

namespace previz::live {

// A set's description of a camera, and the camera's role ("observer" or "light").
struct CameraOrder {
  std::string role;
  std::string driver;
  std::string device;
  set::CameraWish wish;
  std::vector<std::string> faults;  // faults to rehearse
  double responsivity = 1;
};

// Announces devices that are plugged into the USB; null if this machine cannot.
using Usb = std::shared_ptr<const usb::Hotplug>;

// Returns a started camera that is opened when the device is there, and again whenever it comes
// back. Throws previz::Error naming file and key if this build does not have the driver or a fault
// cannot be read.
std::unique_ptr<Camera> drive_camera(const set::Set& set, const CameraOrder& order, const Usb& usb);

// Does the same with any opener, so that replay can rehearse faults.
std::unique_ptr<Camera> keep_alive(const set::Set& set, const CameraOrder& order, CameraOpener open,
                                   LifelineHooks hooks = {});

}  // namespace previz::live
