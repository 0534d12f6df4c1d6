#include "drivers/v4l2/find.hpp"

#include <libudev.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <memory>
#include <sstream>

#include "drivers/error.hpp"

namespace previz::v4l2 {
namespace {

struct Unref {
  void operator()(udev* context) const { udev_unref(context); }
  void operator()(udev_enumerate* enumeration) const { udev_enumerate_unref(enumeration); }
  void operator()(udev_device* device) const { udev_device_unref(device); }
};
template <typename Type>
using Owned = std::unique_ptr<Type, Unref>;

const std::string by_id_directory = "/dev/v4l/by-id/", by_path_directory = "/dev/v4l/by-path/";

std::string property(udev_device& device, const char* key) {
  const char* value = udev_device_get_property_value(&device, key);
  return value ? value : "";
}

// Returns what follows `directory` in one of the links; empty if none begins with it.
std::string link_below(const std::string& directory, const std::string& links) {
  std::istringstream words(links);
  for (std::string link; words >> link;)
    if (link.starts_with(directory)) return link.substr(directory.size());
  return {};
}

int number(udev_device& device, const char* attribute) {
  const char* text = udev_device_get_sysattr_value(&device, attribute);
  int value = 0;
  if (text) std::from_chars(text, text + std::strlen(text), value);
  return value;
}

// Returns the place of the USB device that a node belongs to. udev owns the parent, which must not
// be unreferenced.
std::optional<usb::Place> usb_place(udev_device& device) {
  udev_device* parent = udev_device_get_parent_with_subsystem_devtype(&device, "usb", "usb_device");
  if (!parent) return std::nullopt;
  return usb::Place{number(*parent, "busnum"), number(*parent, "devnum")};
}

FoundNode describe(udev_device& device) {
  const std::string links = property(device, "DEVLINKS");
  FoundNode node;
  const char* file = udev_device_get_devnode(&device);
  node.node = file ? file : "";
  node.by_id = link_below(by_id_directory, links);
  node.by_path = link_below(by_path_directory, links);
  node.serial = property(device, "ID_SERIAL_SHORT");
  node.usb = usb_place(device);
  node.product = property(device, "ID_V4L_PRODUCT");
  return node;
}

std::string without(const std::string& directory, const std::string& name) {
  return name.starts_with(directory) ? name.substr(directory.size()) : name;
}

}  // namespace

std::vector<FoundNode> find_nodes() {
  std::vector<FoundNode> found;
  const Owned<udev> context(udev_new());
  if (!context) return found;
  const Owned<udev_enumerate> enumeration(udev_enumerate_new(context.get()));
  udev_enumerate_add_match_subsystem(enumeration.get(), "video4linux");
  udev_enumerate_scan_devices(enumeration.get());
  udev_list_entry* entry = nullptr;
  udev_list_entry_foreach(entry, udev_enumerate_get_list_entry(enumeration.get())) {
    const Owned<udev_device> device(
        udev_device_new_from_syspath(context.get(), udev_list_entry_get_name(entry)));
    if (!device) continue;
    // A UVC camera has a second node, for metadata.
    if (property(*device, "ID_V4L_CAPABILITIES").find(":capture:") == std::string::npos) continue;
    found.push_back(describe(*device));
  }
  return found;
}

std::string stable_name(const FoundNode& node, const std::vector<FoundNode>& found) {
  const bool by_id =
      !node.by_id.empty() && std::ranges::count(found, node.by_id, &FoundNode::by_id) == 1;
  return by_id ? node.by_id : node.by_path;
}

std::string resolve(const std::string& device, const std::vector<FoundNode>& found) {
  if (device.empty()) throw Error("a v4l2 camera needs its by-id or by-path name, or its serial");
  std::string there;
  const FoundNode* meant = nullptr;
  for (const FoundNode& node : found) {
    if (device == node.node)
      throw Error(device + ": video node numbers change; use the stable name \"" +
                  stable_name(node, found) + "\"");
    if (without(by_id_directory, device) == node.by_id ||
        without(by_path_directory, device) == node.by_path || device == node.serial) {
      if (meant)
        throw Error(device + ": two cameras have this name; use \"" + meant->by_path + "\" or \"" +
                    node.by_path + "\" instead");
      meant = &node;
    }
    add_to_list(there, stable_name(node, found));
  }
  if (meant) return meant->node;
  if (device.starts_with("/dev/video"))
    throw Error(device + ": video node numbers change; use a by-id or by-path name");
  throw Error(device + ": not found; connected: " + (there.empty() ? "no cameras" : there));
}

}  // namespace previz::v4l2
