// The pages of words that a rig shows on its display, for a crew that reads them.
#pragma once

#include "daemon/core/output/osd_painter.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

inline bool says(const std::vector<output::OsdText>& texts, const std::string& words) {
  return std::ranges::any_of(
      texts, [&](const auto& text) { return text.text.find(words) != std::string::npos; });
}

class Pages {
 public:
  void show(const output::OsdPage& page) {
    const std::lock_guard lock(mutex_);
    unread_.push_back(page);
    news_.notify_all();
  }
  // The pages until now are of no interest any more.
  void skip() {
    const std::lock_guard lock(mutex_);
    unread_.clear();
  }
  std::size_t unread() const {
    const std::lock_guard lock(mutex_);
    return unread_.size();
  }
  // Reads page after page until the condition holds: no time is assumed, and no page is missed.
  // That page is the next one to be read.
  void until(const std::function<bool(const output::OsdPage&)>& condition,
             const std::string& what = "the page") {
    std::unique_lock lock(mutex_);
    std::string last;
    const auto found = [&] {
      for (; !unread_.empty(); unread_.pop_front()) {
        if (condition(unread_.front())) return true;
        last = words_of(unread_.front());
      }
      return false;
    };
    await(news_, lock, found, [&] { return what + " is not\n" + last; });
  }
  output::OsdPage next() {
    std::unique_lock lock(mutex_);
    await(
        news_, lock, [&] { return !unread_.empty(); }, [] { return std::string("no page"); });
    output::OsdPage page = std::move(unread_.front());
    unread_.pop_front();
    return page;
  }
  // Waits for these words anywhere on a page.
  void until_words(const std::string& words) {
    until(
        [&](const output::OsdPage& page) {
          return words_of(page).find(words) != std::string::npos;
        },
        words);
  }

 private:
  static std::string words_of(const output::OsdPage& page) {
    std::string words;
    for (const auto* texts : {&page.top_left, &page.top_right, &page.column, &page.notices,
                              &page.bottom_left, &page.bottom_right})
      for (const output::OsdText& text : *texts) words += text.text + "\n";
    return words;
  }

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::deque<output::OsdPage> unread_;
};

}  // namespace previz::test
