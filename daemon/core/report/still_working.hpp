// Tells people at a terminal that a command which shows nothing new still works.
#pragma once

#include <chrono>
#include <condition_variable>
#include <iostream>
#include <list>
#include <mutex>
#include <streambuf>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace previz {

// While it lives, and nothing was written to its streams for `patience`, the first of them has a
// line of its words and "3 s", or the line of progress that it has already and "(3 s)" behind it.
// The next thing that is written takes its place. All streams must lead to the same terminal.
class StillWorking {
 public:
  StillWorking(std::string words, const std::vector<std::ostream*>& streams,
               std::chrono::milliseconds patience = std::chrono::seconds(1));
  ~StillWorking();
  StillWorking(const StillWorking&) = delete;
  StillWorking& operator=(const StillWorking&) = delete;

 private:
  class Buffer final : public std::streambuf {
   public:
    Buffer(StillWorking& owner, std::ostream& stream);
    ~Buffer() override { stream_.rdbuf(below_); }
    void write(std::string_view text) { below_->sputn(text.data(), std::streamsize(text.size())); }
    void flush() { below_->pubsync(); }

   private:
    std::streamsize xsputn(const char* text, std::streamsize count) override;
    int overflow(int c) override;
    int sync() override;

    StillWorking& owner_;
    std::ostream& stream_;
    std::streambuf* below_;
  };

  void take_away();  // what was shown
  void show();

  const std::string words_;
  const std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::string line_;   // that was begun and has no end yet
  std::string shown_;  // in place of it
  std::list<Buffer> buffers_;
  std::jthread clock_;
};

}  // namespace previz
