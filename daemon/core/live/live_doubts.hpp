// Says, while the camera is tracked, why corners of tags are farther off than the noise of their
// pictures makes them, on a thread that nothing waits for.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <stop_token>
#include <thread>

#include "daemon/core/report/reports.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::live {

// Once an interval it judges the newest frames by tracking::PoseJudgement, as `previz track` does
// a take. What it doubts stands on the display until such frames are in order again. A cause is
// looked for only where at least one in twenty of them is doubtful, and takes up to 2 s then.
class LiveDoubts {
 public:
  static constexpr std::size_t frames_judged = 100;  // fewer are not judged

  // `reports` outlives the doubts.
  LiveDoubts(const set::Tracking& tracking, const ObserverCalibration& camera,
             report::Reports& reports,
             std::chrono::milliseconds interval = std::chrono::seconds(10));

  // Call these from one thread; they return at once. Frames from before forget() are not judged.
  void add(const tracking::Track& track);
  void forget() { forgets_ = true; }

 private:
  void run(const std::stop_token& stop);
  void judge(const std::deque<tracking::Track>& tracks, const std::stop_token& stop);

  const set::Tracking tracking_;
  const ObserverCalibration camera_;
  report::Reports& reports_;
  const std::chrono::milliseconds interval_;
  bool forgets_ = false;
  std::mutex mutex_;
  std::condition_variable_any stopped_;
  std::deque<tracking::Track> tracks_;  // the newest frames that show tags, under the mutex
  std::jthread thread_;                 // last: it uses all of the above
};

}  // namespace previz::live
