// Pictures of a table with tags, some of them covered for a while, through the tracker and the
// filter of what is shown.
#include "daemon/core/tracking/pose_filter.hpp"
#include "tests/support/pose_error.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::shown_pose_test {

struct Film {
  TagScene scene = small_table();
  set::Tracking settings = settings_for(scene);
  std::unique_ptr<Tracker> tracker = make_apriltag_tracker(settings, scene.lens, {}, Search::parts);
  PoseFilter filter{settings, scene.lens};
  std::mt19937 random{4};
  std::int64_t time_ns = 0;
  std::optional<ShownPose> expected;  // of the last frame, before it was seen
  Track track;

  // The map has tag 1 two millimetres from where it is, so that the pose depends on the tags seen.
  Film() {
    for (set::Tag& tag : scene.tags)
      if (tag.id == 1) tag.world_from_tag[3].x += 0.002;
  }

  static TagScene small_table() {
    TagScene scene = table();
    scene.lens = test::plain_lens(320, 240, 300);
    return scene;
  }

  // The next frame, in which only these tags are not covered.
  std::optional<ShownPose> show(const std::vector<int>& visible) {
    TagScene seen = scene;
    std::erase_if(seen.tags, [&](const set::Tag& tag) {
      return std::ranges::find(visible, tag.id) == visible.end();
    });
    Frame frame = picture(seen, random);
    frame.timestamp_ns = time_ns += kFrameNs;
    track = tracker->track(frame);
    expected = filter.expected(time_ns);
    return filter.shown(track, time_ns);
  }
};

// A hand goes over all tags for eight frames: nothing blinks, and nothing is said to be tracked.
TEST(ShownPose, AHandOverTheTagsDoesNotBlink) {
  Film film;
  const std::vector<int> all = {0, 1, 2};
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(film.show(all)) << film.track.reason;
  const glm::dmat4 before = film.filter.expected(film.time_ns)->world_from_camera;
  for (int i = 1; i <= 8; ++i) {
    const std::optional<ShownPose> shown = film.show({});
    ASSERT_TRUE(shown) << i;
    EXPECT_EQ(film.track.status, TrackStatus::lost);
    EXPECT_FALSE(film.track.pose);
    EXPECT_NEAR(shown->held_s, 1e-9 * i * kFrameNs, 1e-12);
    EXPECT_LT(distance(before, shown->world_from_camera), 0.002) << i;
  }
  const std::optional<ShownPose> back = film.show(all);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->held_s, 0);
  EXPECT_LT(distance(before, back->world_from_camera), 0.002);
}

// Tags go and come one by one, and the poses that they give differ by millimetres.
TEST(ShownPose, PartialSetsOfTagsDoNotMakeItJump) {
  Film film;
  for (int i = 0; i < 25; ++i) ASSERT_TRUE(film.show({0, 1, 2})) << film.track.reason;
  glm::dmat4 last_raw = film.track.pose->world_from_camera, last_shown = last_raw;
  double raw_jump = 0, shown_jump = 0;
  bool first = true;
  const std::vector<std::vector<int>> visible_tags = {
      {0, 1, 2}, {0, 2}, {0, 2}, {1, 2}, {1, 2}, {0, 1}, {0, 1}, {0, 1, 2}, {0, 2}, {0, 1, 2}};
  for (const std::vector<int>& visible : visible_tags) {
    const std::optional<ShownPose> shown = film.show(visible);
    ASSERT_TRUE(film.track.pose) << film.track.reason;
    ASSERT_TRUE(shown);
    EXPECT_LE(square_in_sigmas(film.expected->covariance, film.expected->world_from_camera,
                               shown->world_from_camera),
              pose_surprise * (1 + 1e-3));
    if (!first) {
      raw_jump = std::max(raw_jump, distance(last_raw, film.track.pose->world_from_camera));
      shown_jump = std::max(shown_jump, distance(last_shown, shown->world_from_camera));
    }
    first = false;
    last_raw = film.track.pose->world_from_camera;
    last_shown = shown->world_from_camera;
  }
  std::printf("  largest step: %.2f mm of the poses, %.2f mm shown\n", 1e3 * raw_jump,
              1e3 * shown_jump);
  EXPECT_GT(raw_jump, 0.002);
  EXPECT_LT(shown_jump, 0.4 * raw_jump);
}

}  // namespace previz::tracking::shown_pose_test
