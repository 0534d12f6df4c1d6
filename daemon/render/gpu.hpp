// This header is the Vulkan device as the other rooms see it: it can be opened, named and lost.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/render/picture_memory.hpp"
#include "drivers/error.hpp"

namespace previz::render {

// Which Vulkan 1.3 device with a compute queue is opened. Errors say what is missing and what was
// found.
struct DeviceOptions {
  bool validation = false;  // Khronos validation layer; its messages go to the log and are counted
  std::string name;         // substring of the device's name; empty: the first discrete, else any
  // A CPU device is treated as a graphics card: its memory is reached by copies, and as many
  // samples are in flight, so that a computer without a card runs the code that a card would. The
  // device is still called a CPU. No pixel depends on it.
  bool as_gpu = false;
  // With `validation`: the layer also looks for accesses to memory that no barrier orders.
  bool synchronization = false;
  // Every pass is timed by the device's clock (take_times()). Costs two timestamps a pass.
  bool times_passes = false;
};

// The passes that ran on a device, and their times by its own clock.
struct DeviceTimes {
  struct Pass {
    std::string name;
    std::uint64_t count;
    double ms;  // of all of them
  };
  std::vector<Pass> passes;
  std::uint64_t submissions = 0;
  double waited_ms = 0;       // of the computer, from handing a submission over to its end
  std::uint64_t untimed = 0;  // passes, of submissions with too many of them
};

// The device is gone (VK_ERROR_DEVICE_LOST): a driver crashed, a cable came loose, a hang led to a
// reset. Everything on the device is lost with it.
class DeviceLost : public Error {
 public:
  using Error::Error;
};

class Device;  // daemon/render/device.hpp
std::shared_ptr<Device> open_device(const DeviceOptions& options = {});
// Return a device that is not open yet: reopen_device() opens it once there is a GPU, or any
// device.
std::shared_ptr<Device> awaited_gpu(const DeviceOptions& options = {});
std::shared_ptr<Device> awaited_device(const DeviceOptions& options = {});
// Opens a lost device again, with the same options. Nothing that was created on the device may
// still exist. Throws previz::Error while there is no device; it can be tried again. A device that
// was a GPU, or was awaited as one, is followed by a CPU device only if `cpu_instead`.
void reopen_device(Device& device, bool cpu_instead = false);
bool is_open(const Device& device);  // false after a reopen_device() that threw
bool is_gpu(const Device& device);   // and open
std::string device_name(const Device& device);
PictureMemory memory_of(const Device& device);

// What a device is at the moment, in the crew's words. These two may be called on any thread.
std::string drawing_device(const Device& device);  // "llvmpipe (CPU)"; empty while there is none
bool cpu_stands_in(const Device& device);          // a CPU device, where there was a GPU
std::uint64_t validation_messages(const Device& device);
// Returns what was timed since the last call; nothing where DeviceOptions::times_passes is false.
DeviceTimes take_times(Device& device);

}  // namespace previz::render
