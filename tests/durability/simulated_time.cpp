#include "tests/durability/simulated_time.hpp"

#include <linux/futex.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "drivers/descriptor.hpp"
#include "tests/durability/simulated_time_core.hpp"

namespace previz::test {
namespace simulated {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

thread_local bool takes_part_here = false;
thread_local Waiter* own = nullptr;  // of this thread, while it lets time go on

// Wakes this thread where it polls.
int waker() {
  thread_local const OwnedDescriptor descriptor{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  return descriptor.get();
}

void block(Waiter& waiter) {
  if (!waiter.polls.empty()) {
    while (real_poll(waiter.polls.data(), waiter.polls.size(), -1) < 0 && errno == EINTR) continue;
    return;
  }
  while (waiter.is_woken.load() == 0)
    real_syscall(SYS_futex, &waiter.is_woken, FUTEX_WAIT_PRIVATE, 0, nullptr, nullptr, 0);
}

}  // namespace

Simulation& simulation() {
  static Simulation& it = *new Simulation;  // outlives whatever waits at exit
  return it;
}

bool is_simulated() {
  return takes_part_here && simulation().is_on.load(std::memory_order_relaxed);
}
void take_part(bool takes_part) {
  takes_part_here = takes_part;
}

std::int64_t Simulation::offset_of(clockid_t clock) const {
  switch (clock) {
    case CLOCK_REALTIME:
    case CLOCK_REALTIME_COARSE:
      return wall_offset_ns;
    case CLOCK_BOOTTIME:
      return boot_offset_ns;
    default:
      return 0;
  }
}

std::int64_t Simulation::coalesced(std::int64_t due_ns) const {
  const std::int64_t grain = grain_ns;
  if (due_ns > never - grain) return never;
  return (due_ns + grain - 1) / grain * grain;
}

std::int64_t Simulation::due_of(clockid_t clock, const timespec& time) const {
  if (time.tv_sec > never / second_ns / 2) return never;
  return coalesced(time.tv_sec * second_ns + time.tv_nsec - offset_of(clock));
}

std::int64_t Simulation::due_in(std::int64_t wait_ns) const {
  if (wait_ns < 0 || wait_ns > never / 2) return never;
  return coalesced(now_ns + wait_ns);
}

// Once it is woken, a waiter that does not poll may be gone.
void Simulation::wake(Waiter& waiter) {
  waiters_.remove(&waiter);
  ++running;
  const bool is_blocked = &waiter != own, polls = !waiter.polls.empty();
  if (is_blocked && polls) ::eventfd_write(waiter.polls.back().fd, 1);
  waiter.is_woken = 1;
  if (is_blocked && !polls)
    real_syscall(SYS_futex, &waiter.is_woken, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
}

int Simulation::wake(const void* on, int most) {
  int woken = 0;
  for (auto next = waiters_.begin(); next != waiters_.end() && woken < most;) {
    Waiter* const waiter = *next++;
    if (waiter->on != on) continue;
    wake(*waiter);
    ++woken;
  }
  return woken;
}

// Descriptors may have become readable by what ran last.
bool Simulation::wake_ready() {
  std::vector<pollfd> all;
  for (const Waiter* waiter : waiters_)
    all.insert(all.end(), waiter->polls.begin(), waiter->polls.end());
  if (all.empty() || real_poll(all.data(), all.size(), 0) <= 0) return false;
  auto polled = all.begin();
  bool has_woken = false;
  for (auto next = waiters_.begin(); next != waiters_.end();) {
    Waiter* const waiter = *next++;
    bool is_ready = false;
    for (std::size_t i = 0; i < waiter->polls.size(); ++i) is_ready |= (polled++)->revents != 0;
    if (!is_ready) continue;
    wake(*waiter);
    has_woken = true;
  }
  return has_woken;
}

std::int64_t Simulation::next_due_ns() const {
  std::int64_t next_ns = never;
  for (const Waiter* waiter : waiters_) next_ns = std::min(next_ns, waiter->due_ns);
  for (const auto& [descriptor, timer] : timers) next_ns = std::min(next_ns, timer.due_ns);
  return next_ns;
}

void Simulation::pass(std::int64_t time_ns) {
  ++jumps;
  if (now_ns < time_ns) now_ns = time_ns;
  for (auto& [descriptor, timer] : timers) {
    if (timer.due_ns > now_ns) continue;
    ::eventfd_write(descriptor, 1);
    timer.due_ns = timer.interval_ns > 0 ? timer.due_ns + timer.interval_ns : never;
  }
  for (auto next = waiters_.begin(); next != waiters_.end();) {
    Waiter* const waiter = *next++;
    if (waiter->due_ns > now_ns) continue;
    waiter->is_late = true;
    wake(*waiter);
  }
}

void Simulation::go_on_if_all_wait() {
  while (running == 0 && !wake_ready()) {
    const std::int64_t next_ns = next_due_ns();
    if (next_ns != never) {
      pass(next_ns);
      continue;
    }
    // Only a descriptor can end a wait now, from outside.
    if (std::ranges::any_of(waiters_, [](const Waiter* waiter) { return !waiter->polls.empty(); }))
      return;
    std::fputs("simulated time: every thread waits for another\n", stderr);
    std::abort();
  }
}

bool Simulation::wait(std::unique_lock<std::mutex> lock, Waiter& waiter) {
  const bool polls = !waiter.polls.empty();
  if (polls) waiter.polls.push_back({waker(), POLLIN, 0});
  waiters_.push_back(&waiter);
  --running;
  own = &waiter;
  go_on_if_all_wait();
  own = nullptr;
  const bool is_woken = waiter.is_woken != 0;
  lock.unlock();
  if (!is_woken) block(waiter);
  if (!polls) return !waiter.is_late;
  lock.lock();
  if (waiter.is_woken == 0) {  // a descriptor has become readable
    waiters_.remove(&waiter);
    ++running;
  } else if (!is_woken) {
    eventfd_t ignored = 0;
    ::eventfd_read(waker(), &ignored);
  }
  return !waiter.is_late;
}

void Simulation::leave() {
  --running;
  go_on_if_all_wait();
}

int poll_until(pollfd* descriptors, nfds_t count, std::int64_t due_ns) {
  Simulation& s = simulation();
  for (;;) {
    const int ready = real_poll(descriptors, count, 0);
    if (ready != 0 || s.now_ns >= due_ns) return ready;
    Waiter waiter{.due_ns = due_ns, .polls = {descriptors, descriptors + count}};
    std::unique_lock lock(s.mutex);
    if (waiter.polls.empty()) waiter.polls.push_back({-1, 0, 0});
    s.wait(std::move(lock), waiter);
  }
}

void sleep_until(std::int64_t due_ns) {
  Simulation& s = simulation();
  std::unique_lock lock(s.mutex);
  Waiter waiter{.due_ns = due_ns};
  if (s.now_ns < due_ns) s.wait(std::move(lock), waiter);
}

}  // namespace simulated

using simulated::simulation;

SimulatedTime::SimulatedTime(std::int64_t wall_ns) {
  simulated::Simulation& s = simulation();
  const std::lock_guard lock(s.mutex);
  constexpr std::int64_t since_boot_ns = 5000 * simulated::second_ns;
  s.now_ns = since_boot_ns;
  s.wall_offset_ns = wall_ns - since_boot_ns;
  s.boot_offset_ns = 0;
  s.grain_ns = 1;
  s.jumps = 0;
  s.running = 1;
  simulated::take_part(true);
  s.is_on = true;
}

SimulatedTime::~SimulatedTime() {
  simulated::Simulation& s = simulation();
  std::unique_lock lock(s.mutex);
  // A thread that nobody joins may still be on its way out, which takes real time.
  for (int times = 0; times < 1000 && s.running != 1; ++times) {
    lock.unlock();
    simulated::real_poll(nullptr, 0, 10);
    lock.lock();
  }
  if (s.running != 1) {
    std::fprintf(stderr, "simulated time: %d threads have not ended\n", s.running - 1);
    std::abort();
  }
  s.is_on = false;
  simulated::take_part(false);
  s.timers.clear();
}

std::int64_t SimulatedTime::now_ns() const {
  return simulation().now_ns;
}
std::int64_t SimulatedTime::wall_ns() const {
  return simulation().now_ns + simulation().wall_offset_ns;
}
std::int64_t SimulatedTime::boot_ns() const {
  return simulation().now_ns + simulation().boot_offset_ns;
}
void SimulatedTime::step_wall_clock(std::int64_t by_ns) {
  simulation().wall_offset_ns += by_ns;
}
void SimulatedTime::suspend(std::int64_t for_ns) {
  simulation().boot_offset_ns += for_ns;
  simulation().wall_offset_ns += for_ns;
}
void SimulatedTime::coalesce_waits(std::int64_t grain_ns) {
  simulation().grain_ns = std::max<std::int64_t>(grain_ns, 1);
}
void SimulatedTime::sleep_exactly_until(std::int64_t time_ns) const {
  simulated::sleep_until(time_ns);
}
std::uint64_t SimulatedTime::jumps() const {
  return simulation().jumps;
}

}  // namespace previz::test
