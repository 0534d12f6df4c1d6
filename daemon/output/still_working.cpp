#include "daemon/output/still_working.hpp"

#include "daemon/output/progress.hpp"
#include "drivers/printable.hpp"

namespace previz::output {

using std::chrono::steady_clock;

StillWorking::Buffer::Buffer(StillWorking& owner, std::ostream& stream)
    : owner_(owner), stream_(stream), below_(stream.rdbuf(this)) {}

std::streamsize StillWorking::Buffer::xsputn(const char* text, std::streamsize count) {
  const std::string_view given(text, static_cast<std::size_t>(count));
  const std::lock_guard lock(owner_.mutex_);
  owner_.take_away();
  owner_.last_ = steady_clock::now();
  const auto end = given.rfind('\n');
  if (given == erase_line || end != std::string_view::npos) owner_.line_.clear();
  if (given != erase_line)
    owner_.line_ += given.substr(end == std::string_view::npos ? 0 : end + 1);
  return below_->sputn(text, count);
}

int StillWorking::Buffer::overflow(int c) {
  if (c == traits_type::eof()) return 0;
  const char letter = traits_type::to_char_type(c);
  return xsputn(&letter, 1) == 1 ? c : traits_type::eof();
}

int StillWorking::Buffer::sync() {
  const std::lock_guard lock(owner_.mutex_);
  return below_->pubsync();
}

StillWorking::StillWorking(std::string name, const std::vector<std::ostream*>& streams,
                           std::chrono::milliseconds patience)
    : name_(std::move(name)), patience_(patience) {
  for (std::ostream* const stream : streams) buffers_.emplace_back(*this, *stream);
  clock_ = std::jthread([this](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      wake_.wait_for(lock, stop, patience_ / 2, [] { return false; });
      if (!stop.stop_requested() && steady_clock::now() - last_ >= patience_) show();
    }
  });
}

StillWorking::~StillWorking() {
  clock_.request_stop();
  clock_.join();
  take_away();
}

void StillWorking::take_away() {
  if (!is_shown_) return;
  is_shown_ = false;
  buffers_.front().write(erase_line);
  buffers_.front().write(line_);
  buffers_.front().flush();
}

void StillWorking::show() {
  const std::chrono::duration<double> silent = steady_clock::now() - last_;
  buffers_.front().write(erase_line);
  buffers_.front().write(line_.empty()
                             ? name_ + ": still working, " + duration_words(silent.count())
                             : line_ + " (" + duration_words(silent.count()) + ")");
  buffers_.front().flush();
  is_shown_ = true;
}

}  // namespace previz::output
