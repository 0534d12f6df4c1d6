#include "daemon/control/inhibitor.hpp"

#include <fcntl.h>
#include <systemd/sd-bus.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/descriptor.hpp"

namespace previz::control {

struct Inhibitor::Impl {
  // One kind of lock. logind would give both by one call, but up to systemd 256 it then asks polkit
  // whether the lid's switch may be held off, and no more (systemd issue 33834).
  struct Lock {
    const char* what;             // as logind names it
    const char* happens;          // in words for people
    Impl* impl = nullptr;         // which it belongs to
    sd_bus_slot* call = nullptr;  // not answered yet
    OwnedDescriptor held;         // closing it gives the lock back
  };

  sd_event* loop;
  std::function<void(const std::string&)> trouble;
  sd_bus* bus = nullptr;
  std::array<Lock, 2> locks{Lock{"shutdown", "shut down", this, nullptr, {}},
                            Lock{"sleep", "put to sleep", this, nullptr, {}}};

  Impl(sd_event* on_loop, std::function<void(const std::string&)> on_trouble)
      : loop(on_loop), trouble(std::move(on_trouble)) {}
  ~Impl() { disconnect(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void disconnect() {
    for (Lock& lock : locks) lock.call = sd_bus_slot_unref(lock.call);
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

  void ask(Lock& lock) {
    int result = connect();
    if (result >= 0)
      result = sd_bus_call_method_async(bus, &lock.call, "org.freedesktop.login1",
                                        "/org/freedesktop/login1", "org.freedesktop.login1.Manager",
                                        "Inhibit", on_answer, &lock, "ssss", lock.what, "previzd",
                                        "A take is being recorded", "block");
    if (result < 0) say(lock, std::strerror(-result));
  }

  void take(Lock& lock, sd_bus_message* answer) {
    lock.call = sd_bus_slot_unref(lock.call);
    if (const sd_bus_error* error = sd_bus_message_get_error(answer))
      return say(lock, error->message ? error->message : error->name);
    int descriptor = -1;  // the message's own
    if (const int result = sd_bus_message_read(answer, "h", &descriptor); result < 0)
      return say(lock, std::strerror(-result));
    lock.held = OwnedDescriptor(fcntl(descriptor, F_DUPFD_CLOEXEC, 3));
    if (!lock.held) say(lock, std::strerror(errno));
  }

  void say(const Lock& lock, const std::string& why) const {
    trouble(std::string("the machine may be ") + lock.happens +
            " while a take is being recorded: " + why);
  }

  // sd-bus is C: no exception may pass through it.
  static int on_answer(sd_bus_message* answer, void* asked, sd_bus_error*) {
    try {
      auto& lock = *static_cast<Lock*>(asked);
      lock.impl->take(lock, answer);
    } catch (...) {
      return -ENOMEM;
    }
    return 0;
  }
};

Inhibitor::Inhibitor(sd_event* loop, std::function<void(const std::string&)> trouble)
    : impl_(new Impl(loop, std::move(trouble))) {}
Inhibitor::~Inhibitor() = default;

void Inhibitor::hold(bool wanted) {
  for (Impl::Lock& lock : impl_->locks) {
    if (!wanted) {
      lock.call = sd_bus_slot_unref(lock.call);  // an answer that still comes closes its lock
      lock.held = OwnedDescriptor();
    } else if (!lock.held && !lock.call) {
      impl_->ask(lock);
    }
  }
}

bool Inhibitor::is_held() const {
  return std::ranges::all_of(impl_->locks,
                             [](const Impl::Lock& lock) { return static_cast<bool>(lock.held); });
}

}  // namespace previz::control
