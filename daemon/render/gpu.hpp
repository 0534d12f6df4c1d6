// This header is the Vulkan device as the other rooms see it: it can be opened, named and lost.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/error.hpp"

namespace previz::render {

// Which Vulkan 1.3 device with a compute queue is opened. Errors say what is missing and what was
// found.
struct DeviceOptions {
  bool validation = false;  // Khronos validation layer; its messages go to the log and are counted
  std::string name;         // substring of the device's name; empty: the first discrete, else any
};

// The device is gone (VK_ERROR_DEVICE_LOST): a driver crashed, a cable came loose, a hang led to a
// reset. Everything on the device is lost with it.
class DeviceLost : public Error {
 public:
  using Error::Error;
};

class Device;  // daemon/render/device.hpp
std::shared_ptr<Device> open_device(const DeviceOptions& options = {});
// Opens a lost device again, with the same options. Nothing that was created on the device may
// still exist. Throws previz::Error while there is no device; it can be tried again.
void reopen_device(Device& device);
bool is_open(const Device& device);  // false after a reopen_device() that threw
std::string device_name(const Device& device);
std::uint64_t validation_messages(const Device& device);

}  // namespace previz::render
