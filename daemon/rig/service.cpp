#include "daemon/rig/service.hpp"

#include <systemd/sd-daemon.h>

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <stop_token>
#include <system_error>
#include <utility>
#include <vector>

namespace previz::rig {
namespace {

// What is asked for at a time while the rig starts or stops; asked again in every interval.
constexpr const char* more_time = "EXTEND_TIMEOUT_USEC=15000000";

// A quarter of WatchdogSec=, or a second where there is no watchdog: sd_watchdog_enabled(3)
// recommends at most a half, and a busy machine may be late by one interval.
std::chrono::milliseconds interval() {
  std::uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return std::chrono::seconds(1);
  return std::chrono::milliseconds(std::clamp<std::uint64_t>(microseconds / 4000, 1, 5000));
}

}  // namespace

Service::Service(const pipeline::Liveness& liveness, report::Reports& reports, std::stop_token stop)
    : liveness_(liveness), reports_(reports), stop_(std::move(stop)) {
  thread_ = std::jthread([this](const std::stop_token& end) { run(end); });
}

Service::~Service() = default;

void Service::run(const std::stop_token& end) {
  std::mutex mutex;
  std::condition_variable_any ended;
  std::unique_lock lock(mutex);
  while (!end.stop_requested()) {
    try {
      const std::vector<std::string> hung = liveness_.hung();
      feed(hung);
      report_hung(hung);
    } catch (const std::exception&) {
      // There is no memory; the watchdog is fed the next time, or somebody must restart the rig.
    }
    ended.wait_for(lock, end, interval(), [] { return false; });
  }
}

void Service::feed(const std::vector<std::string>& hung) const {
  const bool is_live = is_closing_take_ ? std::ranges::count(hung, main_thread) == 0 : hung.empty();
  if (!is_live) return;
  const Phase phase = phase_;
  const bool is_to_stop = stop_.stop_requested() || phase == Phase::stopping;
  if (phase == Phase::running) sd_notify(0, "WATCHDOG=1");
  if (is_to_stop != (phase == Phase::starting)) sd_notify(0, more_time);
}

void Service::report_hung(const std::vector<std::string>& hung) {
  std::string names;
  for (const std::string& name : hung) names += (names.empty() ? "" : ", ") + name;
  if (names == reported_) return;
  reported_ = names;
  if (!names.empty()) reports_({report::Severity::error, "", "stopped responding: " + names});
}

void Service::ready(const std::string& status) {
  phase_ = Phase::running;
  sd_notify(0, ("READY=1\nWATCHDOG=1\nSTATUS=" + status).c_str());
}

void Service::status(const std::string& status) {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void Service::stopping() {
  phase_ = Phase::stopping;
  sd_notify(0, "STOPPING=1");
}

// See proc(5): the link's text then ends so.
bool Service::program_was_replaced(const char* link) {
  std::error_code unknown;
  return std::filesystem::read_symlink(link, unknown).string().ends_with(" (deleted)");
}

// See proc(5): the kinds of block devices follow after an empty line.
std::string Service::device_kinds(const char* file) {
  std::string kinds;
  std::ifstream list(file);
  for (std::string line; std::getline(list, line) && !line.empty();) kinds += line + "\n";
  return kinds;
}

}  // namespace previz::rig
