// The main thread's loop over descriptors, signals and timers, on top of sd-event.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>

struct sd_event;

namespace previz::rig {

class EventLoop {
 public:
  // The callback is called while the Watch lives. A callback may destroy any watch, even its own.
  class Watch {
   public:
    virtual ~Watch() = default;
  };
  using Callback = std::function<void()>;

  // The constructor and the functions below throw previz::Error if the system refuses.
  EventLoop();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  // This watch is level-triggered: it calls again as long as the descriptor is readable.
  std::unique_ptr<Watch> on_readable(int descriptor, Callback callback);
  std::unique_ptr<Watch> every(std::chrono::milliseconds interval, Callback callback);
  // The signal must be blocked in every thread.
  std::unique_ptr<Watch> on_signal(int signal, Callback callback);

  // Runs until exit(). An exception in a callback ends run(), which rethrows it.
  void run();
  void exit();

  sd_event* handle() const { return event_; }

 private:
  sd_event* event_ = nullptr;
};

}  // namespace previz::rig
