#include "daemon/core/check/check_tracking.hpp"

#include <algorithm>
#include <string>

#include "daemon/core/fit/parts.hpp"
#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/core/tracking/pose_judgement.hpp"
#include "drivers/error.hpp"

namespace previz::check {

void remark_on_tracking(const pipeline::Take& take, set::Findings& findings) {
  if (!take.set.tracking.enabled || take.set.tracking.tags.empty()) return;
  tracking::PoseJudgement judgement(take.set.tracking, take.observer);
  pipeline::TrackStage track(take);
  const std::size_t frames = take.observer_stream->records().size();
  const std::size_t parts = std::min(fit::frames_judged, frames);
  std::size_t seen = 0, tracked = 0;
  std::string reason;
  for (std::size_t i = 0; i < parts; ++i) {
    pipeline::Shot shot;
    shot.index = (2 * i + 1) * frames / (2 * parts);
    try {
      shot.frame = take.observer_stream->read(shot.index);
    } catch (const Error&) {
      continue;  // it is named with the take's other losses
    }
    track(shot);
    judgement.add(shot.frame, shot.track);
    ++seen;
    if (shot.track.pose) ++tracked;
    if (reason.empty()) reason = shot.track.reason;
  }
  if (seen > 0 && tracked == 0)
    findings.remarks.push_back("tracking: none of " + set::plural(seen, "frame") +
                               " looked at has a pose (" + reason +
                               "); `previz track` looks at all of them");
  for (const std::string& doubt : judgement.doubts())
    findings.remarks.push_back("tracking: " + doubt);
}

}  // namespace previz::check
