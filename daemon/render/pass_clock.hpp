// Measures how long every compute pass of a device takes by the device's own clock, and what a
// frame costs beside its passes: submissions and waiting. Two timestamps are written around each
// pass of a submission, and read when it has been waited for.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/render/gpu.hpp"

namespace previz::render {

class PassClock {
 public:
  // Times nothing; every call is then free.
  PassClock() = default;
  // Throws previz::Error where the queue family has no timestamps.
  PassClock(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
            std::uint32_t queue_family, const std::string& device_name);

  // begin() comes first in a submission's recording, collect() after it has been waited for.
  void begin(const vk::raii::CommandBuffer& commands);
  void start(const vk::raii::CommandBuffer& commands, const std::string& pass);
  void stop(const vk::raii::CommandBuffer& commands);
  void collect(double waited_ms);

  // Returns the sums since the last call, passes in the order in which they first ran.
  DeviceTimes take();

 private:
  bool is_on() const { return static_cast<bool>(*pool_); }

  vk::raii::QueryPool pool_{nullptr};
  double ms_per_tick_ = 0;
  std::uint64_t valid_ = 0;            // mask of a timestamp's bits
  std::vector<std::size_t> recorded_;  // of each pass of the submission, its place in `sums_`
  bool is_open_ = false;               // between start() and stop()
  std::map<std::string, std::size_t> places_;  // in `sums_.passes`
  DeviceTimes sums_;
};

}  // namespace previz::render
