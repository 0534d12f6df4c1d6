// Carries events and what became of snapshots from the stages' threads to the rig's main thread, in
// order, behind one descriptor.
#pragma once

#include <sys/eventfd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/live/mode.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::live {

class Inbox {
 public:
  Inbox() : descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (!descriptor_) throw Error(std::string("cannot create an eventfd: ") + std::strerror(errno));
  }

  int fd() const { return descriptor_.get(); }  // readable while something waits

  void post(Event event) {
    const std::lock_guard lock(mutex_);
    events_.push_back({event});
    eventfd_write(descriptor_.get(), 1);
  }
  // What became of a snapshot: its files, or why there are none.
  struct Snapshot {
    std::string said;
    bool is_saved = false;
  };
  void post(Snapshot snapshot) {
    const std::lock_guard lock(mutex_);
    snapshots_.push_back(std::move(snapshot));
    eventfd_write(descriptor_.get(), 1);
  }
  std::vector<Snapshot> take_snapshots() {
    const std::lock_guard lock(mutex_);
    return std::exchange(snapshots_, {});
  }
  // Call this when the pipeline has ended, with the observer's stream or by a stage's error.
  void finish(bool by_error) {
    const std::lock_guard lock(mutex_);
    finished_ = true;
    by_error_ = by_error;
    eventfd_write(descriptor_.get(), 1);
  }

  std::vector<Event> take() {
    const std::lock_guard lock(mutex_);
    std::vector<Event> events;
    for (const auto& posted : events_) events.push_back(posted.value);
    events_.clear();
    eventfd_t ignored = 0;
    eventfd_read(descriptor_.get(), &ignored);
    return events;
  }
  pipeline::Waiting waiting() const {
    const std::lock_guard lock(mutex_);
    if (events_.empty()) return {};
    return {.values = events_.size(), .oldest_s = events_.front().age_s()};
  }
  bool finished() const {
    const std::lock_guard lock(mutex_);
    return finished_;
  }
  bool finished_by_error() const {
    const std::lock_guard lock(mutex_);
    return by_error_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<pipeline::Pushed<Event>> events_;
  std::vector<Snapshot> snapshots_;
  bool finished_ = false, by_error_ = false;
  OwnedDescriptor descriptor_;
};

}  // namespace previz::live
