// The Vulkan device as the other rooms see it: it can be opened, named and lost.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/error.hpp"

namespace previz::render {

// A Vulkan 1.3 device with a compute queue. Errors say what is missing and what was found.
struct DeviceOptions {
  bool validation = false;  // Khronos validation layer; its messages go to the log and are counted
  std::string name;         // substring of the device's name; empty: the first discrete, else any
};

// The device is gone (VK_ERROR_DEVICE_LOST): a driver that fell over, a cable, a hang it was reset
// for. Everything on it is lost with it.
class DeviceLost : public Error {
 public:
  using Error::Error;
};

class Device;  // daemon/render/device.hpp
std::shared_ptr<Device> open_device(const DeviceOptions& options = {});
// Opens the device anew, by the same options, after it was lost. Nothing that was made on it may be
// left. Throws previz::Error while there is none; it can be tried again.
void reopen_device(Device& device);
bool is_open(const Device& device);  // not after a reopen_device() that threw
std::string device_name(const Device& device);
std::uint64_t validation_messages(const Device& device);

}  // namespace previz::render
