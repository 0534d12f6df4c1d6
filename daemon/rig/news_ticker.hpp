// What has just happened, for the display: each piece of news long enough to be read, also where
// the next one follows at once.
#pragma once

#include <chrono>
#include <deque>
#include <vector>

#include "daemon/rig/osd.hpp"

namespace previz::rig {

class NewsTicker {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds reading_time{3};
  static constexpr std::size_t lines = 3;  // more push the oldest out

  // The same words again are new again, and stand once.
  void tell(const News& news, Clock::time_point now = Clock::now()) {
    std::erase_if(told_, [&](const Told& told) { return told.news.what == news.what; });
    told_.push_back({news, now});
    if (told_.size() > lines) told_.pop_front();
  }

  // Oldest first.
  std::vector<News> fresh(Clock::time_point now = Clock::now()) {
    std::erase_if(told_, [&](const Told& told) { return now - told.at >= reading_time; });
    std::vector<News> all;
    for (const Told& told : told_) all.push_back(told.news);
    return all;
  }

 private:
  struct Told {
    News news;
    Clock::time_point at;
  };

  std::deque<Told> told_;
};

}  // namespace previz::rig
