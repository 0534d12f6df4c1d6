#include "daemon/core/report/reports.hpp"

#include <algorithm>
#include <ostream>
#include <utility>

namespace previz::report {
namespace {

bool is_trouble(const Notice& notice) {
  return !notice.source.empty();
}

bool takes_the_place_of(const Notice& newer, const Notice& older) {
  return newer.source == older.source && (is_trouble(newer) || newer.text == older.text);
}

bool is_power_of_ten(std::uint64_t number) {
  while (number % 10 == 0 && number > 0) number /= 10;
  return number == 1;
}

// Returns "1st", "2nd", "3rd", "4th", "11th", "21st".
std::string ordinal(std::uint64_t number) {
  const std::uint64_t last = number % 10;
  const bool is_regular = last == 0 || last > 3 || number / 10 % 10 == 1;
  return std::to_string(number) + (is_regular ? "th" : last == 1 ? "st" : last == 2 ? "nd" : "rd");
}

Report numbered(Report report, std::uint64_t times) {
  report.text.insert(std::min(report.text.find('\n'), report.text.size()),
                     ", the " + ordinal(times) + " time in this run");
  return report;
}

}  // namespace

void Notices::add(const Notice& notice, Clock::time_point now) {
  std::erase_if(standing_,
                [&](const Standing& older) { return takes_the_place_of(notice, older.notice); });
  standing_.push_back({notice, now});
  const auto is_news = [](const Standing& one) { return !is_trouble(one.notice); };
  if (std::ranges::count_if(standing_, is_news) > static_cast<std::ptrdiff_t>(most_news))
    standing_.erase(std::ranges::find_if(standing_, is_news));
}

void Notices::settle(const std::string& source) {
  for (Standing& one : standing_)
    if (one.notice.source == source) one.notice.lasts = false;
}

void Notices::forget_what_was_read(Clock::time_point now) {
  std::erase_if(standing_, [&](const Standing& one) {
    const auto time = is_trouble(one.notice) ? trouble_time : news_time;
    return !one.notice.lasts && now - one.since >= time;
  });
}

std::vector<Notice> Notices::standing(bool troubles, Clock::time_point now) {
  forget_what_was_read(now);
  std::vector<Notice> found;
  for (const Standing& one : standing_)
    if (is_trouble(one.notice) == troubles) found.push_back(one.notice);
  return found;
}

std::vector<Notice> Notices::troubles(Clock::time_point now) {
  std::vector<Notice> found = standing(true, now);
  std::ranges::sort(found, {}, &Notice::source);
  return found;
}

std::vector<Notice> Notices::news(Clock::time_point now) {
  return standing(false, now);
}

void Reports::take(const Report& report, Clock::time_point now) {
  if (report.key.empty()) {
    log_(report);
  } else {
    const std::uint64_t times = ++said_[report.key];
    if (report.logs_all || is_power_of_ten(times))
      log_(times == 1 ? report : numbered(report, times));
  }
  if (report.notice) notices_.add(*report.notice, now);
}

void Reports::operator()(const Report& report, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  take(report, now);
}

void Reports::announce(const Report& report, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  take(report, now);
  announced_ = line_of(report);
}

void Reports::show(const Notice& notice, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  notices_.add(notice, now);
}

void Reports::settle(const std::string& source) {
  const std::lock_guard lock(mutex_);
  notices_.settle(source);
}

std::vector<Notice> Reports::troubles(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  return notices_.troubles(now);
}

std::vector<Notice> Reports::news(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  return notices_.news(now);
}

std::string Reports::announced() const {
  const std::lock_guard lock(mutex_);
  return announced_;
}

void Reports::begin_set() {
  const std::lock_guard lock(mutex_);
  notices_ = {};
  announced_.clear();
}

Reports::Log lines_to(std::ostream& out) {
  return [&out](const Report& report) { out << line_of(report) << std::endl; };
}

}  // namespace previz::report
