// Knows whether the threads that must be live are: whether one of them has been at the same piece
// of work for longer than it may take.
#pragma once

#include <chrono>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/host_clock.hpp"

namespace previz::pipeline {

// How long one piece of work may take before its thread counts as hung. Each is far beyond what
// work takes on the slowest machine, because a restart costs the rig its picture and a take its
// continuity.
struct Patience {
  std::chrono::milliseconds loop{30'000};     // one turn of the main loop
  std::chrono::milliseconds camera{120'000};  // one call of a camera's driver, which may reset it
  std::chrono::milliseconds stage{120'000};   // one frame in a stage on the processor
  // One frame or one batch of samples; a device that does not answer for ten minutes is given up by
  // the renderer itself.
  std::chrono::milliseconds render{900'000};
  std::chrono::milliseconds set{600'000};    // reading the first set, or opening devices for a set
  std::chrono::milliseconds ending{20'000};  // giving devices back once the take is closed
};

// All functions may be called from any thread.
class Liveness {
 private:
  struct Work {
    std::string name;
    std::optional<HostClock::Time> due;  // absent: the thread waits for others
  };

 public:
  // What one thread says of itself. A thread that waits for others is well, however long it waits:
  // a silent camera or a stage without frames is no reason for a restart.
  class Pulse {
   public:
    Pulse(Liveness& liveness, std::string name);  // the liveness outlives the pulse
    ~Pulse();
    Pulse(const Pulse&) = delete;
    Pulse& operator=(const Pulse&) = delete;

    // The thread begins a piece of work that may take so long, or goes on with the next one.
    void begin(std::chrono::milliseconds patience);
    void wait();  // the thread waits for others

   private:
    Liveness& liveness_;
    std::list<Work>::iterator work_;
  };

  explicit Liveness(HostClock clock = {}) : clock_(std::move(clock)) {}

  // Returns the names of the threads that are hung.
  std::vector<std::string> hung() const;

 private:
  const HostClock clock_;
  mutable std::mutex mutex_;
  std::list<Work> works_;
};

}  // namespace previz::pipeline
