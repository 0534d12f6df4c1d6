// This header wraps the Vulkan device and its compute queue. It is internal to the render room: it
// includes Vulkan-Hpp, so nothing outside daemon/core/render/ may include it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/core/render/device/device_limits.hpp"
#include "daemon/core/render/device/device_memory.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/device/programs.hpp"
#include "daemon/core/render/device/submissions.hpp"
#include "daemon/core/render/picture/scratch.hpp"
#include "drivers/card_picture.hpp"

namespace previz::render {

// The images of pictures that are shared with a display (drivers/card_picture.hpp).
inline constexpr vk::Format card_picture_format = vk::Format::eR8G8B8A8Unorm;
inline constexpr vk::ImageUsageFlags card_picture_usage =
    vk::ImageUsageFlagBits::eTransferDst | vk::ImageUsageFlagBits::eSampled;

class Device {
 public:
  // A CPU device reads texels where it addresses so many, of 256 MiB; Vulkan guarantees 65536.
  static constexpr std::uint32_t enough_texels = 1 << 24;

  // Throws previz::Error saying what is missing and which devices were found.
  explicit Device(DeviceOptions options);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  struct Awaited {
    bool gpu;  // and no CPU device in its place
  };
  // Opens nothing; reopen() opens a GPU.
  Device(DeviceOptions options, Awaited awaited);
  // Closes and opens the device again. Throws as the constructor does, and can be called again
  // after that. Where there was a GPU, a CPU device is taken only if `cpu_instead`: drivers list
  // one while a GPU is being reset, and it would never be left.
  void reopen(bool cpu_instead);
  bool is_open() const { return static_cast<bool>(*device_); }  // false after a reopen() that threw

  const vk::raii::Device& vk() const { return device_; }
  std::uint32_t queue_family() const { return queue_family_; }
  const std::string& name() const { return name_; }
  std::string driver() const;  // its name and version, as it gives them
  // What graphics cards need that Vulkan does not have (drivers_missing()).
  const std::vector<std::string>& missing_drivers() const { return missing_drivers_; }
  const vk::PhysicalDeviceLimits& limits() const { return limits_; }
  const DeviceLimits& allows() const { return allows_; }
  bool is_cpu() const { return is_cpu_; }
  // Returns whether the driver can be asked to keep the lanes of a subgroup together
  // (with_uniform_subgroups()).
  bool lanes_meet() const { return lanes_meet_; }
  // Returns whether the host works in the device's own memory; otherwise it uploads and downloads
  // by copies, and the device is wide enough to have many samples in flight.
  bool shares_host_memory() const { return is_cpu_ && !options_.as_gpu; }
  // Returns whether what many invocations read at random is read as storage, rather than as texels
  // (shaders/lib/fetch.glsl).
  bool reads_storage() const {
    return !shares_host_memory() || limits_.maxTexelBufferElements < enough_texels;
  }
  // From now on buffers as large as a picture lie in files (create_picture_buffer()), if the host
  // works in the device's memory and its driver can take memory that is there. Null: no longer.
  void use_scratch(std::shared_ptr<Scratch> scratch) { scratch_ = std::move(scratch); }
  // What they lie in; null: nowhere but in the device's memory.
  const std::shared_ptr<Scratch>& scratch() const { return scratch_; }
  bool imports_host_memory() const { return imports_host_memory_; }
  // Returns whether rays are traced by the device's own units, through RayStructures.
  bool traces_in_hardware() const { return scratch_alignment_ > 0; }
  // Returns the alignment, in bytes, of the memory in which a structure is built.
  vk::DeviceSize scratch_alignment() const { return scratch_alignment_; }
  // What is open now; may be called on any thread.
  struct Drawing {
    std::string name;  // empty: nothing is open
    bool is_cpu = false, stands_in = false;
  };
  Drawing drawing() const {
    const std::lock_guard lock(drawing_mutex_);
    return drawing_;
  }
  // Returns what names the device for displays that its pictures can be shown on; nothing where the
  // driver shares no memory, or there is nothing to be saved because the host works in it.
  const std::optional<CardIdentity>& card() const { return card_; }
  std::uint64_t validation_messages() const { return validation_messages_; }
  // Returns whether debug labels, which GPU debuggers show, can be recorded.
  bool has_labels() const { return has_labels_; }

  const DeviceMemory& memory() const { return memory_; }
  DeviceMemory& memory() { return memory_; }
  Programs& programs() { return programs_; }
  const Programs& programs() const { return programs_; }

  // Calls `record` to add to what the device is to do. Where the host works in the device's memory
  // it is handed over and waited for at once; otherwise submissions() hands it over, with more. If
  // `record` throws, the exception is passed on; what it had recorded may still be done.
  void record(const std::function<void(const vk::raii::CommandBuffer&)>& record);
  Submissions& submissions() { return *submissions_; }
  const Submissions& submissions() const { return *submissions_; }
  PassClock& clock() { return submissions_->clock(); }

  // The buffers for shaders, and the programs, that were made so far, each of which may cost more
  // time than a picture has.
  struct Made {
    std::uint64_t buffers = 0, programs = 0;
    friend bool operator==(const Made&, const Made&) = default;
  };
  Made made() const { return {memory_.made_buffers(), programs_.made()}; }
  // Returns what submissions() were given, and how programs were made.
  DeviceWork work() const;
  void keep_programs();

 private:
  void open(bool cpu_too);
  void close();
  void publish(Drawing drawing);
  void create_instance();
  void note_missing_drivers(std::span<const std::uint32_t> vendors);
  std::string missing_lines() const;
  void pick_physical_device(const std::string& wanted_name, bool cpu_too);
  void create_device();
  void choose_rays();

  const DeviceOptions options_;
  vk::raii::Context context_;
  std::atomic<std::uint64_t> validation_messages_ = 0;
  vk::raii::Instance instance_{nullptr};
  vk::raii::DebugUtilsMessengerEXT messenger_{nullptr};
  vk::raii::PhysicalDevice physical_{nullptr};
  std::uint32_t queue_family_ = 0;
  std::string name_;
  std::optional<CardIdentity> card_;
  vk::PhysicalDeviceLimits limits_;
  DeviceLimits allows_{};
  vk::DeviceSize scratch_alignment_ = 0;  // 0: rays are not traced in hardware
  bool is_cpu_ = false;
  bool lanes_meet_ = false;
  bool imports_host_memory_ = false;
  std::shared_ptr<Scratch> scratch_;
  bool has_labels_ = false;
  bool had_gpu_ = false;  // since it was first opened
  bool missing_is_said_ = false;
  std::vector<std::string> missing_drivers_;
  mutable std::mutex drawing_mutex_;
  Drawing drawing_;
  vk::raii::Device device_{nullptr};
  Programs programs_;
  std::optional<Submissions> submissions_;
  DeviceMemory memory_;
};

// Deletes what the device may be working with: once that is done.
template <typename T>
struct Retire {
  Device* device = nullptr;
  void operator()(T* what) const { device->submissions().keep(std::shared_ptr<T>(what)); }
};

}  // namespace previz::render
