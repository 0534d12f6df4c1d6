#include "daemon/core/tracking/trackers.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "drivers/error.hpp"

namespace previz::tracking {
namespace {

struct Wanted {
  const set::Set& set;
  const ObserverCalibration& calibration;
  std::shared_ptr<const RecordedTrack> recorded;  // null: none
  Search search;
};

struct Kind {
  bool (*suits)(const Wanted& wanted);
  std::unique_ptr<Tracker> (*make)(Wanted& wanted);
};

// The first that suits is made.
constexpr Kind kinds[] = {
    {[](const Wanted& w) { return w.set.tracking.enabled; },
     [](Wanted& w) {
       return make_apriltag_tracker(w.set.tracking, w.calibration.intrinsics,
                                    w.calibration.response, w.search);
     }},
    {[](const Wanted& w) { return w.recorded && !w.recorded->empty(); },
     [](Wanted& w) { return make_recorded_tracker(std::move(w.recorded)); }},
};

}  // namespace

std::unique_ptr<Tracker> make_tracker(const set::Set& set, const ObserverCalibration& calibration,
                                      std::shared_ptr<const RecordedTrack> recorded,
                                      Search search) {
  Wanted wanted{set, calibration, std::move(recorded), search};
  const Kind* kind = std::ranges::find_if(kinds, [&](const Kind& k) { return k.suits(wanted); });
  if (kind == std::end(kinds))
    throw Error(set.file.string() +
                ": tracking.enabled: is false, but the session recorded no poses (track.jsonl)");
  return kind->make(wanted);
}

}  // namespace previz::tracking
