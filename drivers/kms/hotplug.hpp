// Notices when something is plugged into a graphics card, or out of it.
#pragma once

#include <memory>

struct udev;
struct udev_monitor;

namespace previz::kms {

class Hotplug {
 public:
  // Throws previz::Error where udev does not answer.
  Hotplug();

  // Returns whether anything was plugged in or out since the last call. Never blocks.
  bool happened();

 private:
  struct Unref {
    void operator()(udev* context) const;
    void operator()(udev_monitor* monitor) const;
  };
  std::unique_ptr<udev, Unref> context_;
  std::unique_ptr<udev_monitor, Unref> monitor_;
};

}  // namespace previz::kms
