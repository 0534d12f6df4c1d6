// Hands commands to a device's compute queue. They are recorded one behind another, and many are
// handed over at once; several submissions can be under way while the next one is recorded.
// Internal to the render room.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/device/pass_clock.hpp"

namespace previz::render {

class Submissions {
 public:
  struct Options {
    std::string name;         // the device's, for errors
    bool times_passes;        // throws previz::Error where the queue family has no timestamps
    std::uint64_t most_work;  // add_work() hands over what is more
    bool adapts;       // `most_work` is only the beginning: a driver ends what takes too long
    bool host_writes;  // to what the device has written, when that is done
    bool builds_structures = false;  // of rays (daemon/core/render/world/ray_structures.hpp)
  };
  Submissions(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
              std::uint32_t queue_family, Options options);
  // Waits for what is under way, and drops what was recorded.
  ~Submissions();
  Submissions(const Submissions&) = delete;
  Submissions& operator=(const Submissions&) = delete;

  // All calls throw DeviceLost naming the device if it is lost, and previz::Error for other errors.

  // Returns the commands that the next submission will have, to add to them.
  const vk::raii::CommandBuffer& recording();
  // Hands over what was recorded, without waiting for it.
  void flush();
  // Hands it over, and waits until all is done.
  void finish() { wait(next_); }
  // Waits until this submission is done, which is handed over first if need be.
  void wait(std::uint64_t submission);
  // Says how much has been recorded since the last call: samples of a pixel. A submission is ended
  // when it has as much as the device should get at once.
  void add_work(std::uint64_t samples);

  // Submissions have numbers 1, 2, ... in their order. Returns that of the one being recorded.
  std::uint64_t next() const { return next_; }
  // Returns that of the last one that is known to be done; so are all before it.
  std::uint64_t done() const { return done_; }
  bool is_idle() const { return !is_recording_ && done_ + 1 == next_; }

  // Keeps something until what was recorded so far is done.
  void keep(std::shared_ptr<const void> what);

  // Makes what earlier dispatches and transfers wrote visible to later dispatches (and their
  // indirect arguments) and transfers.
  void barrier(const vk::raii::CommandBuffer& commands);

  PassClock& clock() { return clock_; }
  DeviceWork work;  // counted since the device was opened

 private:
  // What is needed again only when the submission is done. There are as many as can be under way,
  // with the one that is being recorded.
  struct Slot {
    vk::raii::CommandBuffer commands{nullptr};
    std::uint64_t submission = 0;  // its last one
    std::uint64_t work = 0;
  };
  Slot& slot_of(std::uint64_t submission) { return slots_[submission % slots_.size()]; }
  void refuse_after_failure() const;
  void await(std::uint64_t submission);
  bool is_done(std::uint64_t submission) const;
  void collect(std::uint64_t done, double waited_ms);
  void adapt(const Slot& slot, double ms);

  const vk::raii::Device& device_;
  Options options_;
  vk::raii::Queue queue_{nullptr};
  vk::raii::Semaphore timeline_{nullptr};  // has the number of the last submission that is done
  vk::raii::CommandPool pool_{nullptr};
  std::array<Slot, 3> slots_;
  PassClock clock_;
  bool is_recording_ = false;
  bool has_failed_ = false;  // a submission was not taken: what comes next would lack it
  std::uint64_t next_ = 1, done_ = 0;
  std::deque<std::pair<std::uint64_t, std::shared_ptr<const void>>> kept_;  // by submission
};

}  // namespace previz::render
