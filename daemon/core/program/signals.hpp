// Turns SIGINT and SIGTERM into a stop request.
#pragma once

#include <atomic>
#include <chrono>
#include <optional>
#include <stop_token>
#include <thread>

namespace previz {

// While an object of this class lives, SIGINT and SIGTERM are blocked in the constructing thread
// and in every thread started after it. The first signal to arrive requests a stop; a second one
// ends the process at once, and so does the end of its patience, whatever keeps it busy. What it
// had not finished is then removed (session::abandon_drafts()), and its exit status is 128 + the
// signal; a process without patience, a rig, leaves its drafts to the next start. Construct the
// object in main, before any other thread.
class StopOnSignal {
 public:
  explicit StopOnSignal(std::optional<std::chrono::milliseconds> patience = std::nullopt);
  ~StopOnSignal();
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  std::stop_token token() const { return stop_.get_token(); }
  // Returns the signal that arrived; 0 if none has.
  int received() const { return received_; }

 private:
  std::stop_source stop_;
  std::atomic<int> received_ = 0;
  std::jthread waiter_;
};

}  // namespace previz
