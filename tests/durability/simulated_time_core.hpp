// The clock of SimulatedTime and whoever waits for it, for the functions that stand before the C
// library's (simulated_time_calls.cpp).
#pragma once

#include <dlfcn.h>
#include <poll.h>
#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <ctime>
#include <list>
#include <map>
#include <mutex>
#include <vector>

namespace previz::test::simulated {

inline constexpr std::int64_t never = INT64_MAX;

// A function of the C library, looked up at its first call. It needs no constructor, because
// libraries call these functions before ours have run.
template <typename Function>
class Real {
 public:
  // A name of which glibc has versions on some processors is given with the one that is in use.
  explicit constexpr Real(const char* name, const char* version = nullptr)
      : name_(name), version_(version) {}
  template <typename... Arguments>
  auto operator()(Arguments... arguments) {
    Function* function = found_.load(std::memory_order_relaxed);
    if (!function) {
      void* found = version_ ? ::dlvsym(RTLD_NEXT, name_, version_) : nullptr;
      if (!found) found = ::dlsym(RTLD_NEXT, name_);
      function = reinterpret_cast<Function*>(found);
      found_.store(function, std::memory_order_relaxed);
    }
    return function(arguments...);
  }

 private:
  const char* const name_;
  const char* const version_;
  std::atomic<Function*> found_ = nullptr;
};

inline constinit Real<int(pollfd*, nfds_t, int)> real_poll{"poll"};
inline constinit Real<long(long, ...)> real_syscall{"syscall"};

// A thread that waits.
struct Waiter {
  const void* on = nullptr;  // a condition variable, a futex or a thread; null: nothing of these
  std::int64_t due_ns = never;
  std::vector<pollfd> polls = {};  // descriptors, the last of which wakes the thread
  std::atomic<int> is_woken = 0;
  bool is_late = false;  // the time was over
};

// A timer whose descriptor is an eventfd.
struct Timer {
  clockid_t clock = CLOCK_MONOTONIC;
  std::int64_t due_ns = never;
  std::int64_t interval_ns = 0;
};

class Simulation {
 public:
  std::mutex mutex;  // protects all that is no atomic; it is taken after the program's mutexes
  std::atomic<bool> is_on = false;
  std::atomic<std::int64_t> now_ns = 0, wall_offset_ns = 0, boot_offset_ns = 0, grain_ns = 1;
  std::atomic<std::uint64_t> jumps = 0;
  int running = 0;
  std::map<int, Timer> timers;

  std::int64_t offset_of(clockid_t clock) const;
  // Returns when a wait until this time of this clock ends.
  std::int64_t due_of(clockid_t clock, const timespec& time) const;
  std::int64_t due_in(std::int64_t wait_ns) const;
  std::int64_t coalesced(std::int64_t due_ns) const;

  // Lets the lock go and waits. Returns false if the time was over first.
  bool wait(std::unique_lock<std::mutex> lock, Waiter& waiter);
  // Call these with the lock held.
  int wake(const void* on, int most);
  void leave();  // the calling thread ends

 private:
  void wake(Waiter& waiter);
  void go_on_if_all_wait();
  bool wake_ready();
  std::int64_t next_due_ns() const;
  void pass(std::int64_t time_ns);

  std::list<Waiter*> waiters_;  // first come, first woken
};

Simulation& simulation();
// Returns whether the calling thread goes by the simulated clock.
bool is_simulated();
void take_part(bool takes_part);

int poll_until(pollfd* descriptors, nfds_t count, std::int64_t due_ns);
void sleep_until(std::int64_t due_ns);

}  // namespace previz::test::simulated
