// Finds the video node that a stable name means. Not for use outside the driver.
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
  std::optional<usb::Place> usb = {};  // for cameras on the USB
};

// Asks udev for every node that captures; finds none if there is no udev.
std::vector<FoundNode> find_nodes();

// Returns the name to write into a set: by-id, or by-path if another node that was found has the
// same id (udev makes the id from the model if there is no serial number).
std::string stable_name(const FoundNode& node, const std::vector<FoundNode>& found);

// Returns the node that `device` names. Throws previz::Error that says why the name is none, or
// which nodes are there.
std::string resolve(const std::string& device, const std::vector<FoundNode>& found);

}  // namespace previz::v4l2
