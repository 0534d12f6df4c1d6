#include "daemon/core/report/still_working.hpp"

#include "daemon/core/report/printable.hpp"

namespace previz {

using std::chrono::steady_clock;

// A longer line may take two rows of a terminal, of which only one can be written anew.
constexpr std::size_t longest_line = 79;

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

StillWorking::StillWorking(std::string words, const std::vector<std::ostream*>& streams,
                           std::chrono::milliseconds patience)
    : words_(std::move(words)), patience_(patience) {
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
  if (shown_.empty()) return;
  shown_.clear();
  buffers_.front().write(erase_line);
  buffers_.front().write(line_);
  buffers_.front().flush();
}

void StillWorking::show() {
  const auto silent = std::chrono::duration_cast<std::chrono::seconds>(steady_clock::now() - last_);
  const std::string seconds = std::to_string(silent.count()) + " s";
  const std::string text = line_.empty() ? words_ + ", " + seconds : line_ + " (" + seconds + ")";
  if (text == shown_ || text.size() > longest_line) return;
  buffers_.front().write(erase_line);
  buffers_.front().write(text);
  buffers_.front().flush();
  shown_ = text;
}

}  // namespace previz
