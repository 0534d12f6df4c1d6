// Reports to systemd: that the rig is ready, that it stops, and that its threads are live.
#pragma once

#include <atomic>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/pipeline/liveness.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::rig {

// Talks to systemd's notification socket; outside systemd every call does nothing. See
// sd_notify(3), sd_watchdog_enabled(3).
//
// A thread of its own feeds systemd's watchdog for as long as no thread that must be live is hung.
// Frames do not matter: a camera that is silent, a picture that takes minutes or a scene that is
// being read are no reason for a restart. The recorder's thread is not among those that must be
// live, because a disk that hangs would hang for the next process, too, and what waits in memory
// for it would be lost. While the rig starts or ends, the same thread asks for more time, but none
// to start what is to stop already.
class Service {
 public:
  // The liveness and the reports outlive it; `stop` is asked whether the rig is to stop.
  Service(const pipeline::Liveness& liveness, report::Reports& reports, std::stop_token stop);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  void ready(const std::string& status);
  void status(const std::string& status);
  void stopping();
  // While a take is being closed, the main thread alone decides whether the rig is live: it waits
  // for the disk, and what else hangs is no reason to end a process that writes a take.
  void closing_take(bool is_closing) { is_closing_take_ = is_closing; }
  static constexpr const char* main_thread = "main loop";  // its name in the liveness

  // Returns whether the program's file was replaced or removed since the process began, as an
  // upgrade does; `link` is where the kernel names the file.
  static bool program_was_replaced(const char* link = "/proc/self/exe");
  // Returns the kernel's list of kinds of character devices, "226 drm" and so on; "" if it cannot
  // be read. A service may open those that were there when it started (DeviceAllow= of the unit).
  static std::string device_kinds(const char* file = "/proc/devices");
  // The exit status of a daemon that wants to be started again, as another version or to open
  // devices of a new kind; the unit knows it.
  static constexpr int start_again = 75;

 private:
  enum class Phase { starting, running, stopping };

  void run(const std::stop_token& end);
  void feed(const std::vector<std::string>& hung) const;
  void report_hung(const std::vector<std::string>& hung);

  const pipeline::Liveness& liveness_;
  report::Reports& reports_;
  const std::stop_token stop_;
  std::atomic<Phase> phase_ = Phase::starting;
  std::atomic<bool> is_closing_take_ = false;
  std::string reported_;  // the threads that were reported as hung
  std::jthread thread_;
};

}  // namespace previz::rig
