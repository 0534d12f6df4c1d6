// Keeps the machine from being shut down or put to sleep, by inhibitor locks of systemd-logind.
#pragma once

#include <functional>
#include <memory>
#include <string>

struct sd_event;

namespace previz::control {

// See https://systemd.io/INHIBITOR_LOCKS/. Without logind, or if logind refuses, nothing is kept
// from happening, and `trouble` is called on the loop's thread with what was wrong, each time and
// for each of the two.
class Inhibitor {
 public:
  Inhibitor(sd_event* loop, std::function<void(const std::string&)> trouble);
  ~Inhibitor();  // gives the locks back, as the end of the process does
  Inhibitor(const Inhibitor&) = delete;
  Inhibitor& operator=(const Inhibitor&) = delete;

  // Asks for each lock that is neither held nor asked for, or gives them back. Returns at once: the
  // answers are handled by the loop.
  void hold(bool wanted);
  bool is_held() const;  // both

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::control
