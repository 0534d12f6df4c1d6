// The main thread's loop: descriptors, signals and timers, by sd-event.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>

struct sd_event;

namespace previz::rig {

class EventLoop {
 public:
  // While it lives, the callback is called; it may destroy any watch, its own too.
  class Watch {
   public:
    virtual ~Watch() = default;
  };
  using Callback = std::function<void()>;

  // Throws previz::Error, here and below, where the system refuses.
  EventLoop();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  // Level-triggered: again as long as the descriptor is readable.
  std::unique_ptr<Watch> on_readable(int descriptor, Callback callback);
  std::unique_ptr<Watch> every(std::chrono::milliseconds interval, Callback callback);
  // The signal must be blocked in every thread.
  std::unique_ptr<Watch> on_signal(int signal, Callback callback);

  // Until exit(). An exception of a callback ends it and passes on.
  void run();
  void exit();

  sd_event* handle() const { return event_; }

 private:
  sd_event* event_ = nullptr;
};

}  // namespace previz::rig
