// Keeps what a driver has compiled of the passes, in a file for each device and driver, so that the
// next start takes it from there. Internal to the render room.
#pragma once

#include <filesystem>
#include <future>
#include <string>
#include <vulkan/vulkan_raii.hpp>

namespace previz::render {

class PipelineCache {
 public:
  PipelineCache() = default;  // keeps nothing
  // Takes up the device's file, if `folder` has it. A file that is damaged is left out, and
  // replaced later; what goes wrong with files is logged and no error.
  PipelineCache(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
                const std::filesystem::path& folder);
  ~PipelineCache();  // waits for a save() that is under way
  PipelineCache(PipelineCache&&) noexcept = default;
  PipelineCache& operator=(PipelineCache&&) noexcept = default;

  const vk::raii::PipelineCache& get() const { return cache_; }
  // Begins to write the file anew, in a thread of its own. Returns false if the last save() is
  // still under way, and it is to be tried again.
  bool save();
  // Waits until the file is written.
  void finish();

  // The largest file; a device whose passes take more has none. The 25 passes of a set take up to
  // 2 MB, and Programs::most a tenth of this.
  static constexpr std::uintmax_t most_bytes = 256u << 20;
  // The folder keeps the files of the devices and drivers that were used last.
  static constexpr std::size_t most_files = 4;

 private:
  std::filesystem::path file_;
  vk::raii::PipelineCache cache_{nullptr};
  std::future<void> saving_;
};

}  // namespace previz::render
