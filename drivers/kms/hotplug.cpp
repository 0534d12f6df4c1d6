#include "drivers/kms/hotplug.hpp"

#include <libudev.h>

#include "drivers/error.hpp"

namespace previz::kms {

void Hotplug::Unref::operator()(udev* context) const {
  udev_unref(context);
}

void Hotplug::Unref::operator()(udev_monitor* monitor) const {
  udev_monitor_unref(monitor);
}

// Listens to the kernel's own events, for which udev's rules need not run first.
Hotplug::Hotplug()
    : context_(udev_new()),
      monitor_(context_ ? udev_monitor_new_from_netlink(context_.get(), "kernel") : nullptr) {
  if (!monitor_ ||
      udev_monitor_filter_add_match_subsystem_devtype(monitor_.get(), "drm", nullptr) < 0 ||
      udev_monitor_enable_receiving(monitor_.get()) < 0)
    throw Error("udev: cannot watch for screens being plugged in");
}

bool Hotplug::happened() {
  bool any = false;
  while (udev_device* device = udev_monitor_receive_device(monitor_.get())) {
    udev_device_unref(device);
    any = true;
  }
  return any;
}

}  // namespace previz::kms
