// What becomes of a live picture: it is counted, recorded as it was shown if the set asks for that,
// and handed to the screen; snapshots are written.
#pragma once

#include <cstdint>
#include <functional>

#include "daemon/core/live/inbox.hpp"
#include "daemon/core/live/look.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::live {

// Counts and reports anything odd about a picture that is to be shown.
void count_picture(const pipeline::Shot& shot, pipeline::Metrics& metrics,
                   report::Reports& reports);

class LiveOutput {
 public:
  struct Parts {  // outlive the output
    const set::Set& set;
    output::Recorder& recorder;
    const pipeline::Newest<Look>& look;
    Inbox& inbox;
    std::function<void(pipeline::Shot)> show;  // on the display's thread
    pipeline::StageKeeper::Parts kept;
  };
  LiveOutput(Parts parts, const ObserverCalibration& calibration);

  // Each is called on a thread of its own, and reports what fails.
  void show(pipeline::Shot shot);
  void write_snapshot(const pipeline::Shot& shot) const;

 private:
  void record_shown(const pipeline::Shot& shot);

  const Parts parts_;
  const set::Set calibrated_;  // the set with the film camera's calibration in force
  std::uint64_t shown_frames_ = 0;
  pipeline::StageKeeper recording_, displaying_;  // on the display's thread
};

}  // namespace previz::live
