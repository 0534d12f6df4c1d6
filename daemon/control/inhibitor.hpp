// Keeps the machine from being shut down or put to sleep, by an inhibitor lock of systemd-logind.
#pragma once

#include <functional>
#include <memory>
#include <string>

struct sd_event;

namespace previz::control {

// See https://systemd.io/INHIBITOR_LOCKS/. Without logind, or if logind refuses, nothing is kept
// from happening, and `trouble` is called on the loop's thread with what was wrong, each time.
class Inhibitor {
 public:
  Inhibitor(sd_event* loop, std::function<void(const std::string&)> trouble);
  ~Inhibitor();  // gives the lock back, as the end of the process does
  Inhibitor(const Inhibitor&) = delete;
  Inhibitor& operator=(const Inhibitor&) = delete;

  // Asks for the lock, unless it is held or asked for, or gives it back. Returns at once: the
  // answer is handled by the loop.
  void hold(bool wanted);
  bool is_held() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::control
