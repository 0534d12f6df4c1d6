// Progress of a long job, for people: one rewritten line on a terminal, plain lines elsewhere.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <mutex>
#include <string>

namespace previz::post {

// "47 s", "3:05", "2:03:05"; for times to come and times past.
std::string duration_words(double seconds);

class Progress {
 public:
  // `total_frames` are still to be done. Times are in seconds of any one clock.
  Progress(std::ostream& out, bool terminal, std::uint64_t total_frames, double start_s);

  // Within a frame; shown on a terminal only.
  void sample(std::uint64_t frame, int done, int total, double now_s);
  // A frame is finished; `text` says how.
  void frame_done(const std::string& text, double now_s);
  // A line that stays.
  void note(const std::string& text);

 private:
  void clear_line();
  std::string rate_and_rest(double frames_done, double now_s) const;

  std::mutex mutex_;  // the render and the output stage both report
  std::ostream& out_;
  const bool terminal_;
  const std::uint64_t total_;
  const double start_s_;
  std::uint64_t done_ = 0;
  bool line_shown_ = false;
};

}  // namespace previz::post
