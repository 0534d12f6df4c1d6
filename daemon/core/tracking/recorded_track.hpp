// Plays back the poses that a session recorded, as a tracker that looks at no pictures.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "daemon/core/tracking/tracker.hpp"

namespace previz::tracking {

// Holds the lines of a session's track.jsonl, found by the times of frames. `lap_ns` is the length
// of one lap if the frames are replayed in a loop (replay_lap_ns), otherwise 0.
class RecordedTrack {
 public:
  explicit RecordedTrack(const std::vector<session::TrackRecord>& records, std::int64_t lap_ns = 0);

  bool empty() const { return by_timestamp_.empty(); }
  // Returns the line of the frame itself; null if the track has none. `timestamp_ns` may be of any
  // lap.
  const session::TrackRecord* at(std::int64_t timestamp_ns) const;
  // Returns the line of the frame, or of the last frame before it that has one.
  const session::TrackRecord* newest(std::int64_t timestamp_ns) const;

 private:
  std::int64_t recorded_ns(std::int64_t timestamp_ns) const;

  std::map<std::int64_t, session::TrackRecord> by_timestamp_;
  std::int64_t lap_ns_;
};

// The tracker reads only the frames' times. A frame is lost if it has no line or was lost when it
// was recorded. The tracks have no carriers.
std::unique_ptr<Tracker> make_recorded_tracker(std::shared_ptr<const RecordedTrack> track);

}  // namespace previz::tracking
