// From what a set wishes of a camera to one that is kept alive.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/set/set.hpp"
#include "drivers/camera.hpp"
#include "drivers/faults.hpp"
#include "drivers/lifeline.hpp"
#include "drivers/usb/usb.hpp"

namespace previz::rig {

// A camera of the set: its role ("observer" or "light"), and what the set says of it.
struct CameraOrder {
  std::string role;
  std::string driver;
  std::string device;
  set::CameraWish wish;
  std::vector<std::string> faults;  // to rehearse
  double responsivity = 1;
};

// The rig's USB; null where it does not tell of devices that come.
using Usb = std::shared_ptr<const usb::Hotplug>;

// A started camera that is opened when it is there, and again whenever it is back. Throws
// previz::Error naming file and key if this build has no such driver or a fault cannot be read.
std::unique_ptr<Camera> drive_camera(const set::Set& set, const CameraOrder& order, const Usb& usb);

// The same of any opener; for replay to rehearse faults.
std::unique_ptr<Camera> keep_alive(const set::Set& set, const CameraOrder& order, CameraOpener open,
                                   LifelineHooks hooks = {});

}  // namespace previz::rig
