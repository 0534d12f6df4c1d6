// Decides which tracker a set asks for; nothing else does.
#pragma once

#include <memory>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/recorded_track.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Returns the tracker of the observer with this calibration. `recorded` is the track that the
// session recorded; it may be null if the set does not ask for it. `search` is how tags are
// searched. Throws previz::Error if the set asks for recorded poses and there are none, and as the
// trackers do.
std::unique_ptr<Tracker> make_tracker(const set::Set& set, const ObserverCalibration& calibration,
                                      std::shared_ptr<const RecordedTrack> recorded,
                                      Search search = Search::whole);

}  // namespace previz::tracking
