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

Service::Service(const pipeline::Liveness& liveness, report::Reports& reports)
    : liveness_(liveness), reports_(reports) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

Service::~Service() = default;

void Service::run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any ended;
  std::unique_lock lock(mutex);
  while (!stop.stop_requested()) {
    try {
      const std::vector<std::string> hung = liveness_.hung();
      if (hung.empty()) sd_notify(0, is_running_ ? "WATCHDOG=1" : more_time);
      report_hung(hung);
    } catch (const std::exception&) {
      // There is no memory; the watchdog is fed the next time, or somebody must restart the rig.
    }
    ended.wait_for(lock, stop, interval(), [] { return false; });
  }
}

void Service::report_hung(const std::vector<std::string>& hung) {
  std::string names;
  for (const std::string& name : hung) names += (names.empty() ? "" : ", ") + name;
  if (names == reported_) return;
  reported_ = names;
  if (!names.empty()) reports_({report::Severity::error, "", "does not answer any more: " + names});
}

void Service::ready(const std::string& status) {
  is_running_ = true;
  sd_notify(0, ("READY=1\nWATCHDOG=1\nSTATUS=" + status).c_str());
}

void Service::status(const std::string& status) {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void Service::stopping() {
  is_running_ = false;
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
