// Distributes every report to the log, to the display's notices and to the bus.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <iosfwd>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/core/report/report.hpp"

namespace previz::report {

// Keeps the notices that the display shows now. Not thread-safe; the caller passes the time.
class Notices {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds trouble_time{4}, news_time{3};  // reading time
  static constexpr std::size_t most_news = 3;                           // more push the oldest out

  // Adds a notice; it replaces a trouble of the same source, or the same news.
  void add(const Notice& notice, Clock::time_point now);
  // Ends the trouble of a source that works again; the notice goes once there was time to read it.
  void settle(const std::string& source);

  std::vector<Notice> troubles(Clock::time_point now);  // by source
  std::vector<Notice> news(Clock::time_point now);      // oldest first

 private:
  struct Standing {
    Notice notice;
    Clock::time_point since;
  };

  void forget_what_was_read(Clock::time_point now);
  std::vector<Notice> standing(bool troubles, Clock::time_point now);

  std::deque<Standing> standing_;  // oldest first
};

// All calls may come from any thread.
class Reports {
 public:
  using Clock = Notices::Clock;
  using Log = std::function<void(const Report&)>;  // called by one thread at a time

  explicit Reports(Log log) : log_(std::move(log)) {}

  void operator()(const Report& report, Clock::time_point now = Clock::now());
  // Reports what somebody did, or the rig did by itself; the bus publishes it as its message.
  void announce(const Report& report, Clock::time_point now = Clock::now());
  // Shows a notice on the display only; the log has it already, or need not have it.
  void show(const Notice& notice, Clock::time_point now = Clock::now());
  void settle(const std::string& source);

  std::vector<Notice> troubles(Clock::time_point now = Clock::now());
  std::vector<Notice> news(Clock::time_point now = Clock::now());
  std::string announced() const;  // the line of the last announcement; empty: there was none

  // Forgets all notices and the announcement, because another set begins, with other devices.
  void begin_set();

 private:
  void take(const Report& report, Clock::time_point now);

  mutable std::mutex mutex_;
  const Log log_;
  std::map<std::string, std::uint64_t> said_;  // how often, by key
  Notices notices_;
  std::string announced_;
};

// Returns a log that writes plain lines and flushes each. `out` must outlive it.
Reports::Log lines_to(std::ostream& out);

}  // namespace previz::report
