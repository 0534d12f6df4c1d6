// Trackers that take no pictures: the poses of a recorded track, by the times of frames.
#include "daemon/core/tracking/trackers.hpp"
#include "tests/support/test.hpp"

namespace previz::tracking::recorded_test {

constexpr std::int64_t interval_ns = 40'000'000;

session::TrackRecord line(std::int64_t index, bool tracked) {
  session::TrackRecord record;
  record.timestamp_ns = index * interval_ns;
  record.tracked = tracked;
  record.world_from_camera[3] = {static_cast<double>(index), 2, 3, 1};
  return record;
}

Track track_at(Tracker& tracker, std::int64_t timestamp_ns) {
  Frame frame;  // without a picture
  frame.timestamp_ns = timestamp_ns;
  return tracker.track(frame);
}

set::Set without_tags() {
  set::Set set;
  set.file = "stage.toml";
  set.tracking.enabled = false;
  return set;
}

TEST(RecordedTracker, GivesThePosesOfTheTrackWithoutAPicture) {
  const auto tracker =
      make_tracker(without_tags(), {},
                   std::make_shared<RecordedTrack>(std::vector{line(1, true), line(2, false)}));
  const Track tracked = track_at(*tracker, 1 * interval_ns);
  EXPECT_EQ(tracked.status, TrackStatus::tracked);
  ASSERT_TRUE(tracked.pose);
  EXPECT_EQ(tracked.pose->world_from_camera[3], glm::dvec4(1, 2, 3, 1));
  EXPECT_TRUE(tracked.pose->tags.empty());
  EXPECT_TRUE(tracked.carriers.empty());

  const Track lost = track_at(*tracker, 2 * interval_ns);
  EXPECT_EQ(lost.status, TrackStatus::lost);
  EXPECT_FALSE(lost.pose);
  EXPECT_THAT(lost.reason, HasSubstr("lost when it was recorded"));
  EXPECT_THAT(track_at(*tracker, 3 * interval_ns).reason, HasSubstr("has no line"));
}

// A lap of two frames: the fourth frame has the time of the second.
TEST(RecordedTracker, FindsTheLinesOfLoopedFrames) {
  const RecordedTrack track({line(5, true), line(6, true)}, 2 * interval_ns);
  ASSERT_TRUE(track.at(8 * interval_ns));
  EXPECT_EQ(track.at(8 * interval_ns)->timestamp_ns, 6 * interval_ns);
  EXPECT_FALSE(track.at(8 * interval_ns + 1));
  ASSERT_TRUE(track.newest(8 * interval_ns + 1));
  EXPECT_EQ(track.newest(8 * interval_ns + 1)->timestamp_ns, 6 * interval_ns);
  EXPECT_FALSE(track.newest(4 * interval_ns));
}

TEST(MakeTracker, SaysWhereRecordedPosesAreMissing) {
  EXPECT_THAT(test::error_of([] { make_tracker(without_tags(), {}, nullptr); }),
              StartsWith("stage.toml: tracking.enabled: "));
}

}  // namespace previz::tracking::recorded_test
