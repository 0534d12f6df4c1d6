#include "daemon/signals.hpp"

#include <unistd.h>
#include <csignal>
#include <ctime>

namespace previz {
namespace {

sigset_t stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

StopOnSignal::StopOnSignal() {
  const sigset_t signals = stop_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  // The waiting thread must leave SIGHUP to the rig's loop.
  sigset_t hangup, before;
  sigemptyset(&hangup);
  sigaddset(&hangup, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &hangup, &before);
  waiter_ = std::jthread([this, signals](const std::stop_token& done) {
    const timespec poll{0, 100'000'000};  // how late the destructor may be noticed
    while (!done.stop_requested()) {
      const int signal = sigtimedwait(&signals, nullptr, &poll);
      if (signal <= 0) continue;
      if (received_ != 0) _exit(128 + signal);
      received_ = signal;
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
