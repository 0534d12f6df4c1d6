#include "daemon/rig/event_loop.hpp"

#include <systemd/sd-event.h>

#include <cstring>
#include <exception>
#include <string>
#include <utility>

#include "drivers/error.hpp"

namespace previz::rig {
namespace {

void check(int result, const char* what) {
  if (result < 0) throw Error(std::string("event loop: ") + what + ": " + std::strerror(-result));
}

class Source final : public EventLoop::Watch {
 public:
  Source(sd_event* event, EventLoop::Callback callback,
         const std::shared_ptr<const EventLoop::OnFault>& on_fault)
      : event_(event),
        callback_(std::make_shared<EventLoop::Callback>(std::move(callback))),
        on_fault_(on_fault) {}
  ~Source() override {
    sd_event_source_set_enabled(source_, SD_EVENT_OFF);
    sd_event_source_unref(source_);
  }

  sd_event_source** out() { return &source_; }
  sd_event_source* get() const { return source_; }
  std::uint64_t interval_us = 0;

  // An exception must not pass through C code, so it is handed to whoever wants it, or kept for
  // run() to rethrow.
  int call() {
    const std::shared_ptr<EventLoop::Callback> alive = callback_;
    const std::shared_ptr<const EventLoop::OnFault> on_fault = on_fault_;
    sd_event* const event = event_;
    try {
      try {
        (*alive)();
      } catch (const std::exception& error) {
        if (!*on_fault) throw;
        (*on_fault)(error);
      }
    } catch (...) {
      failure = std::current_exception();
      sd_event_exit(event, 1);
    }
    return 0;
  }

  static thread_local std::exception_ptr failure;

 private:
  sd_event* event_;
  std::shared_ptr<EventLoop::Callback> callback_;
  std::shared_ptr<const EventLoop::OnFault> on_fault_;
  sd_event_source* source_ = nullptr;
};
thread_local std::exception_ptr Source::failure;

int on_io(sd_event_source*, int, std::uint32_t, void* source) {
  return static_cast<Source*>(source)->call();
}
int on_signal_info(sd_event_source*, const signalfd_siginfo*, void* source) {
  return static_cast<Source*>(source)->call();
}
int on_time(sd_event_source* timer, std::uint64_t, void* data) {
  auto* source = static_cast<Source*>(data);
  sd_event_source_set_time_relative(timer, source->interval_us);
  sd_event_source_set_enabled(timer, SD_EVENT_ONESHOT);
  return source->call();
}

}  // namespace

EventLoop::EventLoop(OnFault on_fault)
    : on_fault_(std::make_shared<const OnFault>(std::move(on_fault))) {
  check(sd_event_new(&event_), "cannot be created");
}

EventLoop::~EventLoop() {
  sd_event_unref(event_);
}

std::unique_ptr<EventLoop::Watch> EventLoop::on_readable(int descriptor, Callback callback) {
  auto source = std::make_unique<Source>(event_, std::move(callback), on_fault_);
  check(sd_event_add_io(event_, source->out(), descriptor, EPOLLIN, on_io, source.get()),
        "a descriptor cannot be watched");
  return source;
}

std::unique_ptr<EventLoop::Watch> EventLoop::every(std::chrono::milliseconds interval,
                                                   Callback callback) {
  auto source = std::make_unique<Source>(event_, std::move(callback), on_fault_);
  source->interval_us = static_cast<std::uint64_t>(std::chrono::microseconds(interval).count());
  check(sd_event_add_time_relative(event_, source->out(), CLOCK_MONOTONIC, source->interval_us,
                                   1000, on_time, source.get()),
        "a timer cannot be created");
  return source;
}

std::unique_ptr<EventLoop::Watch> EventLoop::on_signal(int signal, Callback callback) {
  auto source = std::make_unique<Source>(event_, std::move(callback), on_fault_);
  check(sd_event_add_signal(event_, source->out(), signal, on_signal_info, source.get()),
        "a signal cannot be watched");
  return source;
}

void EventLoop::run() {
  check(sd_event_loop(event_), "failed");
  if (Source::failure) std::rethrow_exception(std::exchange(Source::failure, nullptr));
}

void EventLoop::exit() {
  sd_event_exit(event_, 0);
}

}  // namespace previz::rig
