// Measures how long every compute pass of a device takes by the device's own clock, and what a
// frame costs beside its passes: submissions and waiting. Two timestamps are written around each
// pass of a submission, and read when it is done. Internal to the render room.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/core/render/device/gpu.hpp"

namespace previz::render {

class PassClock {
 public:
  // Times nothing; every call is then free.
  PassClock() = default;
  // Times as many submissions at once as are `under_way`. Throws previz::Error where the queue
  // family has no timestamps.
  PassClock(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
            std::uint32_t queue_family, const std::string& device_name, std::size_t under_way);

  // begin() comes first in the recording of a submission, which has this number; start() and stop()
  // are for the last one that was begun.
  void begin(std::uint64_t submission);
  void start(const vk::raii::CommandBuffer& commands, const std::string& pass);
  void stop(const vk::raii::CommandBuffer& commands);
  // Adds a submission that is done. Returns how long its passes took.
  double collect(std::uint64_t submission);
  void add_wait(double ms);  // of the computer, for the device

  // Passes since the last take() that found no room, or whose times the driver did not have.
  std::uint64_t untimed() const { return sums_.untimed; }
  // Returns the sums since the last call, passes in the order in which they first ran.
  DeviceTimes take();

 private:
  struct Submission {
    vk::raii::QueryPool pool{nullptr};
    std::vector<std::size_t> passes;  // the place of each in `sums_.passes`
  };

  bool is_on() const { return !under_way_.empty(); }

  std::vector<Submission> under_way_;  // a submission's by its number, round and round
  std::size_t recorded_ = 0;           // the last that was begun
  double ms_per_tick_ = 0;
  std::uint64_t valid_ = 0;                    // mask of a timestamp's bits
  bool is_open_ = false;                       // between start() and stop()
  std::map<std::string, std::size_t> places_;  // in `sums_.passes`
  DeviceTimes sums_;
};

}  // namespace previz::render
