// Shows the progress of a long job: one rewritten line on a terminal, plain lines elsewhere.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <mutex>
#include <string>

namespace previz::output {

// Returns a duration as "47 s", "3:05" or "2:03:05".
std::string duration_words(double seconds);

class Progress {
 public:
  // `total_frames` is the number of frames still to do, and `only_rendered` of those that are
  // rendered for them, as their neighbours. Times are in seconds of any one clock.
  Progress(std::ostream& out, bool terminal, std::uint64_t total_frames, double start_s,
           std::uint64_t only_rendered = 0);

  // Shows progress within a frame, on a terminal only.
  void sample(std::uint64_t frame, int done, int total, double now_s);
  // Reports a frame that is rendered, but finished only together with its neighbours.
  void frame_rendered(std::uint64_t frame, double now_s);
  // Reports a finished frame; `text` describes the result.
  void frame_done(const std::string& text, double now_s);
  // Prints a line that stays.
  void note(const std::string& text);

 private:
  void clear_line();
  std::string rate_and_rest(double part_of_a_frame, double now_s) const;

  std::mutex mutex_;  // the render and the output stage both report
  std::ostream& out_;
  const bool terminal_;
  const std::uint64_t total_;
  const std::uint64_t only_rendered_;
  const double start_s_;
  std::uint64_t done_ = 0, rendered_ = 0;
  bool line_shown_ = false;
};

// Shows the progress of a job whose parts take very different times, by the share of the work that
// is done.
class ShareProgress {
 public:
  // `total` is the whole work in any unit. Times are in seconds of any one clock.
  ShareProgress(std::ostream& out, bool terminal, double total, double start_s);

  // Adds some work of a step; shown on a terminal only.
  void worked(const std::string& step, double work, double now_s);
  // Reports a finished step. Until the last, something is left to do, whatever is counted.
  void step_done(const std::string& text, double now_s, bool is_last = false);

 private:
  std::string share_and_rest(double now_s, bool is_last) const;

  std::ostream& out_;
  const bool terminal_;
  const double total_;
  const double start_s_;
  double done_ = 0;
};

}  // namespace previz::output
