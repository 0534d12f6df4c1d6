// Which video node a stable name means. Not for use outside the driver.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "drivers/usb/usb.hpp"

namespace previz::v4l2 {

// A node that captures, as udev knows it.
struct FoundNode {
  std::string node;     // /dev/video0: changes from boot to boot
  std::string by_id;    // name below /dev/v4l/by-id; empty where the device has no serial number
  std::string by_path;  // name below /dev/v4l/by-path
  std::string serial;
  std::string product;
  std::optional<usb::Place> usb = {};  // of cameras on the USB
};

// Asks udev. None where there is no udev.
std::vector<FoundNode> find_nodes();

// The name to write into a set: by-id, but by-path where another of those found has the same id
// (udev makes it from the model where there is no serial number).
std::string stable_name(const FoundNode& node, const std::vector<FoundNode>& found);

// The node that `device` names. Throws previz::Error that says why it is none, or which are there.
std::string resolve(const std::string& device, const std::vector<FoundNode>& found);

}  // namespace previz::v4l2
