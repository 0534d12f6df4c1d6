// Progress of a long job, for people: one rewritten line on a terminal, plain lines elsewhere.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <mutex>
#include <string>

namespace previz::output {

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

// Progress of a job whose parts take very different times: by the share of the work that is done.
class ShareProgress {
 public:
  // `total`: of any measure of work. Times are in seconds of any one clock.
  ShareProgress(std::ostream& out, bool terminal, double total, double start_s);

  // Some work of a step is done; shown on a terminal only.
  void worked(const std::string& step, double work, double now_s);
  // A step is finished.
  void step_done(const std::string& text, double now_s);

 private:
  std::string share_and_rest(double now_s) const;

  std::ostream& out_;
  const bool terminal_;
  const double total_;
  const double start_s_;
  double done_ = 0;
};

}  // namespace previz::output
