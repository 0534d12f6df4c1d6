// Compiles the pipelines that the crew's buttons can reach before a button is pressed, on a thread
// of its own, so that no picture waits for a compiler. The likeliest come first: those of the first
// picture, if it is not there yet.
//
// It is meant for graphics cards. A driver that draws by the processor makes most of a pipeline at
// its first dispatch, so that little would be gained, and the processor has pictures to draw.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <thread>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"

namespace previz::render {

class PipelinesAhead {
 public:
  // Starts the thread. The device must be open, and stay so until this object is gone. `reachable`
  // returns sets of FEATURE_* bits, the likeliest first (reachable_bits() in feature.hpp); it is
  // called once, on the thread. What cannot be compiled is reported in the log, once, and left to
  // the picture that needs it.
  PipelinesAhead(std::shared_ptr<Device> device,
                 std::function<std::vector<std::uint32_t>()> reachable);
  // Stops, at the latest once the pipeline is there that is being compiled.
  ~PipelinesAhead() = default;
  PipelinesAhead(const PipelinesAhead&) = delete;
  PipelinesAhead& operator=(const PipelinesAhead&) = delete;

  // Returns whether the thread has no more to do.
  bool is_done() const { return is_done_; }
  // Returns whether it has made them all.
  bool has_all() const { return has_all_; }

 private:
  bool work(const std::stop_token& stop) const;

  const std::shared_ptr<Device> device_;
  const std::function<std::vector<std::uint32_t>()> reachable_;
  std::atomic<bool> is_done_ = false, has_all_ = false;
  std::jthread thread_;
};

}  // namespace previz::render
