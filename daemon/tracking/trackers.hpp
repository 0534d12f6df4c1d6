// The one place where it is decided which tracker a set asks for.
#pragma once

#include <memory>

#include "daemon/set/set.hpp"
#include "daemon/tracking/recorded_track.hpp"
#include "daemon/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// The tracker of the observer whose calibration this is. `recorded` is what the session recorded;
// it may be null where the set does not ask for it. Throws previz::Error where the set asks for
// recorded poses and there are none, and as the trackers do.
std::unique_ptr<Tracker> make_tracker(const set::Set& set, const ObserverCalibration& calibration,
                                      std::shared_ptr<const RecordedTrack> recorded);

}  // namespace previz::tracking
