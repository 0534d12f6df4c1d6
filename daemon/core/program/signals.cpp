#include "daemon/core/program/signals.hpp"

#include <unistd.h>
#include <csignal>
#include <ctime>
#include <string_view>

#include "daemon/core/session/draft.hpp"

namespace previz {
namespace {

sigset_t stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

// Ends a command without its drafts. Its other threads go on meanwhile, and may hold any lock.
[[noreturn]] void end_by(int signal) {
  session::abandon_drafts();
  const std::string words = std::string(program_invocation_short_name) +
                            ": stopped; files that were not complete are removed\n";
  [[maybe_unused]] const ssize_t is_told = ::write(STDERR_FILENO, words.data(), words.size());
  _exit(128 + signal);
}

}  // namespace

StopOnSignal::StopOnSignal(std::optional<std::chrono::milliseconds> patience) {
  const sigset_t signals = stop_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  // The waiting thread must leave SIGHUP to the rig's loop.
  sigset_t hangup, before;
  sigemptyset(&hangup);
  sigaddset(&hangup, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &hangup, &before);
  waiter_ = std::jthread([this, signals, patience](const std::stop_token& done) {
    using Clock = std::chrono::steady_clock;
    const timespec poll{0, 100'000'000};              // how late the destructor may be noticed
    constexpr std::chrono::milliseconds as_one(300);  // a group and its leader may both be told
    Clock::time_point first;
    while (!done.stop_requested()) {
      const int signal = sigtimedwait(&signals, nullptr, &poll);
      const auto since = Clock::now() - first;
      if (received_ != 0 && patience && since > *patience && !done.stop_requested())
        end_by(received_);
      if (signal <= 0) continue;
      // A rig's disk may hang, at which nobody waits; the next start removes what is left.
      if (received_ != 0 && since > as_one && !patience) _exit(128 + signal);
      if (received_ != 0 && since > as_one) end_by(signal);
      if (received_ != 0) continue;
      received_ = signal;
      first = Clock::now();
      stop_.request_stop();
    }
  });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

StopOnSignal::~StopOnSignal() {
  waiter_.request_stop();
  waiter_.join();
  const sigset_t signals = stop_signals();
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

}  // namespace previz
