#include "daemon/core/tracking/recorded_track.hpp"

#include <iterator>
#include <utility>

namespace previz::tracking {
namespace {

class RecordedTracker final : public Tracker {
 public:
  explicit RecordedTracker(std::shared_ptr<const RecordedTrack> recorded)
      : recorded_(std::move(recorded)) {}

  Track track(const Frame& frame) override {
    Track track;
    const session::TrackRecord* record = recorded_->at(frame.timestamp_ns);
    if (!record) {
      track.reason = "track.jsonl has no line for this frame";
    } else if (!record->tracked) {
      track.reason = "lost when it was recorded (track.jsonl)";
    } else {
      track.status = TrackStatus::tracked;
      track.pose = {record->world_from_camera, record->covariance, 0, record->tags};
      track.seen_tags = record->tags;
    }
    return track;
  }

  void reset() override {}

 private:
  const std::shared_ptr<const RecordedTrack> recorded_;
};

}  // namespace

RecordedTrack::RecordedTrack(const std::vector<session::TrackRecord>& records, std::int64_t lap_ns)
    : lap_ns_(lap_ns) {
  for (const session::TrackRecord& record : records) by_timestamp_[record.timestamp_ns] = record;
}

std::int64_t RecordedTrack::recorded_ns(std::int64_t timestamp_ns) const {
  const std::int64_t first_ns = empty() ? 0 : by_timestamp_.begin()->first;
  if (lap_ns_ <= 0 || timestamp_ns <= first_ns) return timestamp_ns;
  return first_ns + (timestamp_ns - first_ns) % lap_ns_;
}

const session::TrackRecord* RecordedTrack::at(std::int64_t timestamp_ns) const {
  const auto found = by_timestamp_.find(recorded_ns(timestamp_ns));
  return found == by_timestamp_.end() ? nullptr : &found->second;
}

const session::TrackRecord* RecordedTrack::newest(std::int64_t timestamp_ns) const {
  const auto after = by_timestamp_.upper_bound(recorded_ns(timestamp_ns));
  return after == by_timestamp_.begin() ? nullptr : &std::prev(after)->second;
}

std::unique_ptr<Tracker> make_recorded_tracker(std::shared_ptr<const RecordedTrack> track) {
  return std::make_unique<RecordedTracker>(std::move(track));
}

}  // namespace previz::tracking
