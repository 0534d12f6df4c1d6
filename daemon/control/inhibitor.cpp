#include "daemon/control/inhibitor.hpp"

#include <fcntl.h>
#include <systemd/sd-bus.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/descriptor.hpp"

namespace previz::control {

struct Inhibitor::Impl {
  sd_event* loop;
  std::function<void(const std::string&)> trouble;
  sd_bus* bus = nullptr;
  sd_bus_slot* call = nullptr;  // not answered yet
  OwnedDescriptor lock;         // closing it gives the lock back

  ~Impl() { disconnect(); }

  void disconnect() {
    call = sd_bus_slot_unref(call);
    if (bus) sd_bus_detach_event(bus);
    bus = sd_bus_close_unref(bus);
  }

  // A bus that was restarted leaves a connection that is not open any more.
  int connect() {
    if (bus && sd_bus_is_open(bus) > 0) return 0;
    disconnect();
    if (const int result = sd_bus_open_system(&bus); result < 0) return result;
    return sd_bus_attach_event(bus, loop, SD_EVENT_PRIORITY_NORMAL);
  }

  void ask() {
    int result = connect();
    if (result >= 0)
      result = sd_bus_call_method_async(bus, &call, "org.freedesktop.login1",
                                        "/org/freedesktop/login1", "org.freedesktop.login1.Manager",
                                        "Inhibit", on_answer, this, "ssss", "shutdown:sleep",
                                        "previzd", "A take is being recorded", "block");
    if (result < 0) say(std::strerror(-result));
  }

  void take(sd_bus_message* answer) {
    call = sd_bus_slot_unref(call);
    if (const sd_bus_error* error = sd_bus_message_get_error(answer))
      return say(error->message ? error->message : error->name);
    int descriptor = -1;  // the message's own
    if (const int result = sd_bus_message_read(answer, "h", &descriptor); result < 0)
      return say(std::strerror(-result));
    lock = OwnedDescriptor(fcntl(descriptor, F_DUPFD_CLOEXEC, 3));
    if (!lock) say(std::strerror(errno));
  }

  void say(const std::string& why) const {
    trouble("the machine may be shut down or put to sleep while a take is being recorded: " + why);
  }

  // sd-bus is C: no exception may pass through it.
  static int on_answer(sd_bus_message* answer, void* self, sd_bus_error*) {
    try {
      static_cast<Impl*>(self)->take(answer);
    } catch (...) {
      return -ENOMEM;
    }
    return 0;
  }
};

Inhibitor::Inhibitor(sd_event* loop, std::function<void(const std::string&)> trouble)
    : impl_(new Impl{loop, std::move(trouble), nullptr, nullptr, {}}) {}
Inhibitor::~Inhibitor() = default;

void Inhibitor::hold(bool wanted) {
  if (!wanted) {
    impl_->call = sd_bus_slot_unref(impl_->call);  // an answer that still comes closes its lock
    impl_->lock = OwnedDescriptor();
  } else if (!impl_->lock && !impl_->call) {
    impl_->ask();
  }
}

bool Inhibitor::is_held() const {
  return static_cast<bool>(impl_->lock);
}

}  // namespace previz::control
