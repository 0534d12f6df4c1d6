// This header is the Vulkan device as the other rooms see it: it can be opened, named and lost.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/render/picture/picture_memory.hpp"
#include "daemon/core/render/picture/scratch.hpp"
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
  // With `as_gpu`: as one that is part of the processor, whose memory the host can write.
  bool as_integrated = false;
  // Whether the device's own units trace rays where it has such (VK_KHR_ray_query); absent: those
  // of a graphics card do, and a CPU device, which only pretends to have them, does not. Pictures
  // are the same but for rounding.
  std::optional<bool> hardware_rays = {};
  // With `validation`: the layer also looks for accesses to memory that no barrier orders.
  bool synchronization = false;
  // Every pass is timed by the device's clock (take_times()), as a graphics card's always are if it
  // can do so. Costs two timestamps a pass.
  bool times_passes = false;
  // Folder in which keep_programs() keeps what the driver has compiled; empty: it keeps nothing.
  std::filesystem::path cache = {};
  // Where sysfs is mounted, by which graphics cards are known that Vulkan does not have. What they
  // need is logged once, unless a device is asked for by its name, and is part of errors.
  std::filesystem::path sys = "/sys";
};

// Returns the options for a set that allows rays in hardware or does not, unless they say it
// themselves.
DeviceOptions options_for(DeviceOptions options, bool hardware_rays);

// Returns the folder for files that a program makes again when they are gone, as the XDG Base
// Directory Specification has it: $XDG_CACHE_HOME/previzd, or ~/.cache/previzd; empty: neither is
// known. The service's unit sets XDG_CACHE_HOME.
std::filesystem::path cache_folder();

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
  std::uint64_t untimed = 0;  // passes, of submissions with too many or without times
};

// Names a device and says what it has.
struct DeviceFacts {
  std::string name, driver;  // "NVIDIA H100", "NVIDIA 580.159.04"
  bool is_gpu = false;
  std::uint64_t memory_bytes = 0;                 // all buffers together may take so much
  bool shares_host_memory = false;                // nothing is copied to it
  bool traces_in_hardware = false;                // its own units trace rays
  std::vector<std::string> missing_drivers = {};  // what other graphics cards need, a sentence each
};

// Counts what a device was given to do since it was opened.
struct DeviceWork {
  std::uint64_t submissions = 0;
  std::uint64_t waits = 0;        // of the computer, for the device
  std::uint64_t allocations = 0;  // of device memory
  std::uint64_t barriers = 0;
  std::uint64_t bytes_up = 0, bytes_down = 0;  // copied
  // Pipelines, also those of the device before it was lost and opened again: those that something
  // waited for, and those that were made before anything asked for them
  // (daemon/core/render/passes/pipelines_ahead.hpp).
  std::uint64_t pipelines_awaited = 0, pipelines_ahead = 0;
};

// The device is gone (VK_ERROR_DEVICE_LOST): a driver crashed, a cable came loose, a hang led to a
// reset. Everything on the device is lost with it.
class DeviceLost : public Error {
 public:
  using Error::Error;
};

class Device;  // daemon/core/render/device/device.hpp
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
// From now on what is as large as a picture lies in files, as far as the computer's memory would
// hold it: all of a frame that is rendered by a CPU device, and the frames that are kept.
void use_scratch(Device& device, std::shared_ptr<Scratch> scratch);
const std::shared_ptr<Scratch>& scratch_of(const Device& device);  // null: nothing lies in files
// Keeps what has been compiled since the last call, if anything was, for the next start
// (DeviceOptions::cache). Writes in a thread of its own.
void keep_programs(Device& device);

// What a device is at the moment, in the crew's words. These two may be called on any thread.
std::string drawing_device(const Device& device);  // "llvmpipe (CPU)"; empty while there is none
bool cpu_stands_in(const Device& device);          // a CPU device, where there was a GPU
std::uint64_t validation_messages(const Device& device);
// Returns what was timed since the last call; nothing where no pass is timed.
DeviceTimes take_times(Device& device);
DeviceWork work_of(const Device& device);
DeviceFacts facts_of(const Device& device);
// Measures copies of 64 MiB: returns bytes a second up to the device and down from it. Nothing
// where the host works in the device's memory.
struct CopySpeed {
  double up_bytes_s, down_bytes_s;
};
std::optional<CopySpeed> copy_speed(Device& device);

}  // namespace previz::render
