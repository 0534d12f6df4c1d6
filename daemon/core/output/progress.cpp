#include "daemon/core/output/progress.hpp"
#include "daemon/core/report/printable.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ostream>

namespace previz::output {
namespace {

std::string fixed(double value, int digits) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

}  // namespace

std::string duration_words(double seconds) {
  const auto whole = static_cast<long long>(std::llround(std::max(seconds, 0.0)));
  if (whole < 60) return std::to_string(whole) + " s";
  char buffer[64];
  if (whole < 3600)
    std::snprintf(buffer, sizeof buffer, "%lld:%02lld", whole / 60, whole % 60);
  else
    std::snprintf(buffer, sizeof buffer, "%lld:%02lld:%02lld", whole / 3600, whole / 60 % 60,
                  whole % 60);
  return buffer;
}

Progress::Progress(std::ostream& out, bool terminal, std::uint64_t total_frames, double start_s,
                   std::uint64_t only_rendered)
    : out_(out),
      terminal_(terminal),
      total_(total_frames),
      only_rendered_(only_rendered),
      start_s_(start_s) {}

void Progress::clear_line() {
  if (line_shown_) out_ << erase_line;
  line_shown_ = false;
}

std::string Progress::rate_and_rest(double part_of_a_frame, double now_s) const {
  const double frames_done = static_cast<double>(std::max(done_, rendered_)) + part_of_a_frame;
  if (frames_done <= 0) return "";
  const double seconds_a_frame = (now_s - start_s_) / frames_done;
  double rest = seconds_a_frame * (static_cast<double>(total_ + only_rendered_) - frames_done);
  if (done_ < total_) rest = std::max(rest, 1.0);  // it still works
  const std::string rate = seconds_a_frame < 1 ? fixed(1 / seconds_a_frame, 1) + " frames/s"
                                               : fixed(seconds_a_frame, 1) + " s/frame";
  return ", " + rate + ", " + duration_words(rest) + " left";
}

void Progress::sample(std::uint64_t frame, int done, int total, double now_s) {
  if (!terminal_) return;
  const std::lock_guard lock(mutex_);
  const double part = static_cast<double>(done) / std::max(total, 1);
  clear_line();
  out_ << "frame " << frame << ": " << done << "/" << total << " samples; " << done_ << " of "
       << total_ << (total_ == 1 ? " frame" : " frames") << rate_and_rest(part, now_s)
       << std::flush;
  line_shown_ = true;
}

void Progress::frame_rendered(std::uint64_t frame, double now_s) {
  const std::lock_guard lock(mutex_);
  ++rendered_;
  clear_line();
  out_ << "frame " << frame << ": rendered (" << rendered_ << " of " << total_ + only_rendered_
       << rate_and_rest(0, now_s) << ")" << std::endl;
}

void Progress::frame_done(const std::string& text, double now_s) {
  const std::lock_guard lock(mutex_);
  ++done_;
  clear_line();
  out_ << text << " (" << done_ << " of " << total_ << rate_and_rest(0, now_s) << ")" << std::endl;
}

void Progress::note(const std::string& text) {
  const std::lock_guard lock(mutex_);
  clear_line();
  out_ << text << std::endl;
}

ShareProgress::ShareProgress(std::ostream& out, bool terminal, double total, double start_s)
    : out_(out), terminal_(terminal), total_(total), start_s_(start_s) {}

std::string ShareProgress::share_and_rest(double now_s, bool is_last) const {
  if (is_last) return "100 %";
  const double share = std::min(done_ / total_, 0.99);
  std::string text = std::to_string(static_cast<int>(100 * share)) + " %";
  if (done_ > total_) return text + ", longer than expected";
  if (share > 0)
    text += ", " + duration_words(std::max((now_s - start_s_) * (1 / share - 1), 1.0)) + " left";
  return text;
}

void ShareProgress::worked(const std::string& step, double work, double now_s) {
  done_ += work;
  if (terminal_)
    out_ << erase_line << step << " (" << share_and_rest(now_s, false) << ")" << std::flush;
}

void ShareProgress::step_done(const std::string& text, double now_s, bool is_last) {
  out_ << (terminal_ ? erase_line : std::string_view()) << text << " ("
       << share_and_rest(now_s, is_last) << ")" << std::endl;
}

}  // namespace previz::output
