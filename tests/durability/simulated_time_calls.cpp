// The functions of the C library that tell the time or wait for it, by the clock of SimulatedTime.
#include <fcntl.h>
#include <linux/futex.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdarg>
#include <map>
#include <memory>
#include <utility>

#include "tests/durability/simulated_time_core.hpp"

namespace previz::test::simulated {
namespace {

constexpr std::int64_t look_ns = 20;  // what a look at a clock takes

constinit Real<int(clockid_t, timespec*)> real_clock_gettime{"clock_gettime"};
constinit Real<int(timeval*, void*)> real_gettimeofday{"gettimeofday"};
constinit Real<time_t(time_t*)> real_time{"time"};
constinit Real<int(const timespec*, timespec*)> real_nanosleep{"nanosleep"};
constinit Real<int(clockid_t, int, const timespec*, timespec*)> real_clock_nanosleep{
    "clock_nanosleep"};
constinit Real<int(pthread_cond_t*, pthread_mutex_t*)> real_cond_wait{"pthread_cond_wait",
                                                                      "GLIBC_2.3.2"};
constinit Real<int(pthread_cond_t*, pthread_mutex_t*, const timespec*)> real_cond_timedwait{
    "pthread_cond_timedwait", "GLIBC_2.3.2"};
constinit Real<int(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>
    real_cond_clockwait{"pthread_cond_clockwait"};
constinit Real<int(pthread_cond_t*)> real_cond_signal{"pthread_cond_signal", "GLIBC_2.3.2"};
constinit Real<int(pthread_cond_t*)> real_cond_broadcast{"pthread_cond_broadcast", "GLIBC_2.3.2"};
constinit Real<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)> real_create{
    "pthread_create"};
constinit Real<int(pthread_t, void**)> real_join{"pthread_join"};
constinit Real<int(pthread_t)> real_detach{"pthread_detach"};
constinit Real<int(pollfd*, nfds_t, const timespec*, const sigset_t*)> real_ppoll{"ppoll"};
constinit Real<int(int, epoll_event*, int, int)> real_epoll_wait{"epoll_wait"};
constinit Real<int(int, int)> real_timerfd_create{"timerfd_create"};
constinit Real<int(int, int, const itimerspec*, itimerspec*)> real_timerfd_settime{
    "timerfd_settime"};
constinit Real<int(int)> real_close{"close"};

std::int64_t nanoseconds(const timespec& time) {
  return time.tv_sec * std::int64_t{1'000'000'000} + time.tv_nsec;
}

std::int64_t look_at(clockid_t clock) {
  Simulation& s = simulation();
  return s.now_ns.fetch_add(look_ns) + look_ns + s.offset_of(clock);
}

bool is_of_a_thread(clockid_t clock) {
  return clock == CLOCK_PROCESS_CPUTIME_ID || clock == CLOCK_THREAD_CPUTIME_ID || clock < 0;
}

int wait_for_condition(pthread_cond_t* condition, pthread_mutex_t* mutex, std::int64_t due_ns) {
  Simulation& s = simulation();
  Waiter waiter{.on = condition, .due_ns = due_ns};
  std::unique_lock lock(s.mutex);
  ::pthread_mutex_unlock(mutex);
  const bool is_signalled = s.wait(std::move(lock), waiter);
  ::pthread_mutex_lock(mutex);
  return is_signalled ? 0 : ETIMEDOUT;
}

void wake_waiters(const void* on, int most) {
  Simulation& s = simulation();
  if (!s.is_on) return;
  const std::lock_guard lock(s.mutex);
  s.wake(on, most);
}

struct Thread {
  bool has_ended = false;
};

// What a new thread is given.
struct Start {
  void* (*run)(void*);
  void* argument;
  std::shared_ptr<Thread> thread;
};

void* run_thread(void* start) {
  const std::unique_ptr<Start> begun(static_cast<Start*>(start));
  take_part(true);
  struct End {
    Thread& thread;
    ~End() {
      Simulation& s = simulation();
      const std::lock_guard lock(s.mutex);
      thread.has_ended = true;
      s.wake(&thread, INT32_MAX);
      s.leave();
      take_part(false);
    }
  } const end{*begun->thread};
  return begun->run(begun->argument);
}

std::map<pthread_t, std::shared_ptr<Thread>>& threads() {
  static auto& it = *new std::map<pthread_t, std::shared_ptr<Thread>>;
  return it;
}

int create_thread(pthread_t* id, const pthread_attr_t* attributes, void* (*run)(void*),
                  void* argument) {
  Simulation& s = simulation();
  auto start = std::make_unique<Start>(Start{run, argument, std::make_shared<Thread>()});
  const std::shared_ptr<Thread> thread = start->thread;
  const std::lock_guard lock(s.mutex);
  const int error = real_create(id, attributes, run_thread, start.get());
  if (error != 0) return error;
  static_cast<void>(start.release());
  ++s.running;
  threads()[*id] = thread;
  return 0;
}

void await_end(pthread_t id) {
  Simulation& s = simulation();
  std::unique_lock lock(s.mutex);
  const auto found = threads().find(id);
  if (found == threads().end()) return;
  const std::shared_ptr<Thread> thread = found->second;
  threads().erase(found);
  Waiter waiter{.on = thread.get()};
  if (!thread->has_ended) s.wait(std::move(lock), waiter);
}

int epoll_until(int descriptor, epoll_event* events, int most, std::int64_t due_ns) {
  for (;;) {
    const int ready = real_epoll_wait(descriptor, events, most, 0);
    if (ready != 0) return ready;
    pollfd one{descriptor, POLLIN, 0};
    if (poll_until(&one, 1, due_ns) == 0) return 0;
  }
}

long wait_on_futex(int* futex, int operation, int value, const timespec* time) {
  Simulation& s = simulation();
  const bool is_until = (operation & FUTEX_CMD_MASK) == FUTEX_WAIT_BITSET;
  const clockid_t clock = operation & FUTEX_CLOCK_REALTIME ? CLOCK_REALTIME : CLOCK_MONOTONIC;
  Waiter waiter{.on = futex};
  std::unique_lock lock(s.mutex);
  if (__atomic_load_n(futex, __ATOMIC_SEQ_CST) != value) {
    errno = EAGAIN;
    return -1;
  }
  if (time) waiter.due_ns = is_until ? s.due_of(clock, *time) : s.due_in(nanoseconds(*time));
  if (s.wait(std::move(lock), waiter)) return 0;
  errno = ETIMEDOUT;
  return -1;
}

int set_timer(int descriptor, int flags, const itimerspec& wish) {
  Simulation& s = simulation();
  const std::lock_guard lock(s.mutex);
  const auto found = s.timers.find(descriptor);
  if (found == s.timers.end()) return -1;
  eventfd_t expired = 0;  // of before
  pollfd one{descriptor, POLLIN, 0};
  if (real_poll(&one, 1, 0) > 0) ::eventfd_read(descriptor, &expired);
  Timer& timer = found->second;
  timer.interval_ns = nanoseconds(wish.it_interval);
  if (nanoseconds(wish.it_value) == 0)
    timer.due_ns = never;
  else
    timer.due_ns = flags & TFD_TIMER_ABSTIME ? s.due_of(timer.clock, wish.it_value)
                                             : s.due_in(nanoseconds(wish.it_value));
  return 0;
}

}  // namespace
}  // namespace previz::test::simulated

// These stand before the C library's functions of the same name.
extern "C" {

using namespace previz::test::simulated;

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (!is_simulated() || is_of_a_thread(clock)) return real_clock_gettime(clock, time);
  const std::int64_t now_ns = look_at(clock);
  *time = {now_ns / 1'000'000'000, now_ns % 1'000'000'000};
  return 0;
}
int gettimeofday(timeval* __restrict time, void* __restrict zone) noexcept {
  if (!is_simulated()) return real_gettimeofday(time, zone);
  const std::int64_t now_ns = look_at(CLOCK_REALTIME);
  *time = {now_ns / 1'000'000'000, now_ns % 1'000'000'000 / 1000};
  return 0;
}
time_t time(time_t* seconds) noexcept {
  if (!is_simulated()) return real_time(seconds);
  const time_t now = look_at(CLOCK_REALTIME) / 1'000'000'000;
  if (seconds) *seconds = now;
  return now;
}

int nanosleep(const timespec* time, timespec* left) {
  if (!is_simulated()) return real_nanosleep(time, left);
  sleep_until(simulation().due_in(nanoseconds(*time)));
  return 0;
}
int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  if (!is_simulated()) return real_clock_nanosleep(clock, flags, time, left);
  sleep_until(flags & TIMER_ABSTIME ? simulation().due_of(clock, *time)
                                    : simulation().due_in(nanoseconds(*time)));
  return 0;
}
int usleep(useconds_t microseconds) {
  const timespec time{microseconds / 1'000'000, microseconds % 1'000'000 * 1000};
  return nanosleep(&time, nullptr);
}

int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  if (!is_simulated()) return real_cond_wait(condition, mutex);
  return wait_for_condition(condition, mutex, never);
}
int pthread_cond_timedwait(pthread_cond_t* __restrict condition, pthread_mutex_t* __restrict mutex,
                           const timespec* __restrict until) {
  if (!is_simulated()) return real_cond_timedwait(condition, mutex, until);
  return wait_for_condition(condition, mutex, simulation().due_of(CLOCK_REALTIME, *until));
}
int pthread_cond_clockwait(pthread_cond_t* __restrict condition, pthread_mutex_t* __restrict mutex,
                           clockid_t clock, const timespec* __restrict until) {
  if (!is_simulated()) return real_cond_clockwait(condition, mutex, clock, until);
  return wait_for_condition(condition, mutex, simulation().due_of(clock, *until));
}
int pthread_cond_signal(pthread_cond_t* condition) noexcept {
  wake_waiters(condition, 1);
  return real_cond_signal(condition);  // for threads that do not take part
}
int pthread_cond_broadcast(pthread_cond_t* condition) noexcept {
  wake_waiters(condition, INT32_MAX);
  return real_cond_broadcast(condition);
}

int pthread_create(pthread_t* __restrict id, const pthread_attr_t* __restrict attributes,
                   void* (*run)(void*), void* __restrict argument) noexcept {
  if (!is_simulated()) return real_create(id, attributes, run, argument);
  return create_thread(id, attributes, run, argument);
}
int pthread_join(pthread_t id, void** result) {
  if (is_simulated()) await_end(id);
  return real_join(id, result);
}
int pthread_detach(pthread_t id) noexcept {
  if (is_simulated()) {
    const std::lock_guard lock(simulation().mutex);
    threads().erase(id);
  }
  return real_detach(id);
}

int poll(pollfd* descriptors, nfds_t count, int milliseconds) {
  if (!is_simulated() || milliseconds == 0) return real_poll(descriptors, count, milliseconds);
  return poll_until(descriptors, count,
                    simulation().due_in(milliseconds * std::int64_t{1'000'000}));
}
int ppoll(pollfd* descriptors, nfds_t count, const timespec* time, const sigset_t* mask) {
  if (!is_simulated()) return real_ppoll(descriptors, count, time, mask);
  return poll_until(descriptors, count, time ? simulation().due_in(nanoseconds(*time)) : never);
}
int epoll_wait(int descriptor, epoll_event* events, int most, int milliseconds) {
  if (!is_simulated() || milliseconds == 0)
    return real_epoll_wait(descriptor, events, most, milliseconds);
  return epoll_until(descriptor, events, most,
                     simulation().due_in(milliseconds * std::int64_t{1'000'000}));
}

int timerfd_create(clockid_t clock, int flags) noexcept {
  if (!is_simulated()) return real_timerfd_create(clock, flags);
  static_assert(int{TFD_NONBLOCK} == int{EFD_NONBLOCK} && int{TFD_CLOEXEC} == int{EFD_CLOEXEC});
  const int descriptor = ::eventfd(0, flags);
  const std::lock_guard lock(simulation().mutex);
  if (descriptor >= 0) simulation().timers[descriptor].clock = clock;
  return descriptor;
}
int timerfd_settime(int descriptor, int flags, const itimerspec* wish, itimerspec* old) noexcept {
  if (is_simulated() && set_timer(descriptor, flags, *wish) == 0) return 0;
  return real_timerfd_settime(descriptor, flags, wish, old);
}
int close(int descriptor) {
  if (simulation().is_on) {
    const std::lock_guard lock(simulation().mutex);
    simulation().timers.erase(descriptor);
  }
  return real_close(descriptor);
}

// Each argument has a register of its own, whatever its type.
long syscall(long number, ...) noexcept {
  va_list rest;
  va_start(rest, number);
  std::array<void*, 6> argument{};
  for (void*& one : argument) one = va_arg(rest, void*);
  va_end(rest);
  const auto number_at = [&](std::size_t index) {
    return static_cast<int>(reinterpret_cast<std::intptr_t>(argument[index]));
  };
  const auto really = [&] {
    return real_syscall(number, argument[0], argument[1], argument[2], argument[3], argument[4],
                        argument[5]);
  };
  const auto* time = static_cast<const timespec*>(argument[3]);
  if (number == SYS_epoll_pwait2 && is_simulated())
    return epoll_until(number_at(0), static_cast<epoll_event*>(argument[1]), number_at(2),
                       time ? simulation().due_in(nanoseconds(*time)) : never);
  if (number != SYS_futex) return really();
  auto* const futex = static_cast<int*>(argument[0]);
  const int command = number_at(1) & FUTEX_CMD_MASK;
  if ((command == FUTEX_WAIT || command == FUTEX_WAIT_BITSET) && is_simulated())
    return wait_on_futex(futex, number_at(1), number_at(2), time);
  if (command == FUTEX_WAKE || command == FUTEX_WAKE_BITSET) wake_waiters(futex, number_at(2));
  return really();
}

}  // extern "C"
