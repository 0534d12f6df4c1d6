// The main thread's loop over descriptors, signals and timers, on top of sd-event.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <exception>
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
  using OnFault = std::function<void(const std::exception&)>;

  // `on_fault` is called with what a callback has thrown, and the loop goes on. Without it an
  // exception in a callback ends run(), which rethrows it.
  //
  // The constructor and the functions below throw previz::Error if the system refuses.
  explicit EventLoop(OnFault on_fault = {});
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  // This watch is level-triggered: it calls again as long as the descriptor is readable.
  std::unique_ptr<Watch> on_readable(int descriptor, Callback callback);
  std::unique_ptr<Watch> every(std::chrono::milliseconds interval, Callback callback);
  // The signal must be blocked in every thread.
  std::unique_ptr<Watch> on_signal(int signal, Callback callback);

  // Runs until exit().
  void run();
  void exit();

  sd_event* handle() const { return event_; }

 private:
  const std::shared_ptr<const OnFault> on_fault_;
  sd_event* event_ = nullptr;
};

}  // namespace previz::rig
