#include "daemon/tracking/trackers.hpp"

#include <utility>

#include "drivers/error.hpp"

namespace previz::tracking {

std::unique_ptr<Tracker> make_tracker(const set::Set& set, const ObserverCalibration& calibration,
                                      std::shared_ptr<const RecordedTrack> recorded,
                                      Search search) {
  if (set.tracking.enabled)
    return make_apriltag_tracker(set.tracking, calibration.intrinsics, calibration.response,
                                 search);
  if (!recorded || recorded->empty())
    throw Error(set.file.string() +
                ": tracking.enabled: is false, but the session recorded no poses (track.jsonl)");
  return make_recorded_tracker(std::move(recorded));
}

}  // namespace previz::tracking
