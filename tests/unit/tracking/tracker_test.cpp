// The whole tracker on pictures made by the test: poses, formats, loss. Extremes: tests/extremes.
#include <glm/gtc/matrix_transform.hpp>

#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::tracker_test {

TEST(Tracker, FindsTheCameraFromAllTags) {
  const TagScene scene = table();
  const Track track = track_once(settings_for(scene), scene, 1);
  ASSERT_EQ(track.status, TrackStatus::tracked) << track.reason;
  EXPECT_EQ(track.pose->tags, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(track.seen_tags, (std::vector<int>{0, 1, 2}));
  EXPECT_TRUE(track.reason.empty()) << track.reason;
  EXPECT_LT(track.pose->reprojection_rms_px, 0.1);
  // Five standard deviations of what it claims; and what it claims is small.
  EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera),
            5 * translation_sigma(*track.pose));
  EXPECT_LT(angle_between(track.pose->world_from_camera, scene.world_from_camera),
            5 * rotation_sigma(*track.pose));
  EXPECT_LT(translation_sigma(*track.pose), 0.002);
}

TEST(Tracker, ReadsEveryPixelFormat) {
  const TagScene scene = table();
  for (PixelFormat format : {PixelFormat::rgb8, PixelFormat::rgb16, PixelFormat::gray8,
                             PixelFormat::gray16, PixelFormat::yuv422p8}) {
    const Track track = track_once(settings_for(scene), scene, 1, format);
    ASSERT_EQ(track.status, TrackStatus::tracked) << to_string(format) << track.reason;
    EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera), 0.003)
        << to_string(format);
  }
}

TEST(Tracker, KnowsTheFamiliesOfTheLibrary) {
  // Not the largest three, whose tables take hundreds of megabytes.
  for (const char* family :
       {"tag16h5", "tag25h9", "tag36h10", "tagStandard41h12", "tagCircle21h7"}) {
    TagScene scene = table();
    scene.family = family;
    for (set::Tag& tag : scene.tags) tag.size_m = 0.06;
    const Track track = track_once(settings_for(scene), scene, 2);
    ASSERT_EQ(track.status, TrackStatus::tracked) << family << ": " << track.reason;
    EXPECT_EQ(track.pose->tags.size(), 3u) << family << ": " << track.reason;
    EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera), 0.003) << family;
  }
}

TEST(Tracker, RefusesWhatCannotBe) {
  const TagScene scene = table();
  const auto refusal = [&](const set::Tracking& settings) {
    return test::error_of([&] { make_apriltag_tracker(settings, scene.lens); });
  };
  set::Tracking settings = settings_for(scene);
  settings.family = "tag99";
  EXPECT_THAT(refusal(settings), HasSubstr("tag36h11"));
  settings = settings_for(scene);
  settings.tags[1].id = 0;
  EXPECT_THAT(refusal(settings), HasSubstr("twice"));
  settings = settings_for(scene);
  settings.tags[1].size_m = 0;
  EXPECT_THAT(refusal(settings), HasSubstr("size"));
}

TEST(Tracker, SaysWhyItIsLost) {
  TagScene scene = table();
  std::mt19937 random(3);
  const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens);
  const auto reason = [&](const TagScene& s) {
    const Track track = tracker->track(picture(s, random));
    EXPECT_EQ(track.status, TrackStatus::lost);
    EXPECT_FALSE(track.pose);
    return track.reason;
  };
  TagScene empty = scene;
  empty.tags.clear();
  EXPECT_THAT(reason(empty), HasSubstr("no tag"));
  TagScene strange = scene;
  strange.tags = {flat_tag(77, 0.08, {0, 0, 0})};
  EXPECT_THAT(reason(strange), HasSubstr("not in the set file: tag 77"));
  TagScene larger = scene;
  larger.lens = test::plain_lens(500, 360, 450);
  EXPECT_THAT(reason(larger), HasSubstr("500x360"));
  Frame truncated = picture(scene, random);
  truncated.bytes.resize(100);
  EXPECT_EQ(tracker->track(truncated).status, TrackStatus::lost);
}

// A tag half outside is seen by libapriltag with corners on the border, several px off.
TEST(Tracker, LeavesOutTagsCutByTheBorder) {
  TagScene scene = table();
  std::mt19937 random(4);
  int seen_cut = 0;
  for (double slide = 0.05; slide < 0.25; slide += 0.006) {
    scene.world_from_camera = camera_looking({slide, -0.5, 0.45}, {slide, 0.05, 0});
    const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens);
    const Track track = tracker->track(picture(scene, random));
    seen_cut += track.reason.find("border") != std::string::npos;
    if (track.status != TrackStatus::tracked) continue;
    EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera),
              5 * translation_sigma(*track.pose));
    EXPECT_LT(track.pose->reprojection_rms_px, 0.3);
  }
  EXPECT_GT(seen_cut, 0);
}

TEST(Tracker, ReportsAMovedTag) {
  TagScene scene = table();
  scene.tags.push_back(flat_tag(3, 0.08, {0.05, 0.2, 0}, 1.0));
  TagScene moved = scene;
  moved.tags[1] = flat_tag(1, 0.08, {0.2, -0.01, 0}, 0.45);
  const Track track = track_once(settings_for(scene), moved, 5);
  ASSERT_EQ(track.status, TrackStatus::tracked) << track.reason;
  EXPECT_EQ(track.pose->tags, (std::vector<int>{0, 2, 3}));
  EXPECT_THAT(track.reason, HasSubstr("tag 1: not where the set file says"));
  EXPECT_LT(distance(track.pose->world_from_camera, scene.world_from_camera), 0.003);
}

TEST(Tracker, TwoTagsAtOddsAreNotGuessedAbout) {
  TagScene scene = table();
  scene.tags.pop_back();
  TagScene moved = scene;
  moved.tags[1] = flat_tag(1, 0.08, {0.17, 0.05, 0}, 0.7);
  const Track track = track_once(settings_for(scene), moved, 6);
  EXPECT_EQ(track.status, TrackStatus::lost);
  EXPECT_THAT(track.reason, HasSubstr("disagree"));
}

// Normalised errors of whole pictures: mean of n chi-squares of 6 degrees, standard error
// sqrt(12/n). The floor of 0.03 px is more than this noise, so only the upper bound is sharp.
TEST(Tracker, CovarianceHoldsOnPictures) {
  TagScene scene = table();
  scene.lens = test::plain_lens(320, 240, 300);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  const int trials = 40;
  double sum = 0;
  int counted = 0;
  for (int t = 0; t < trials; ++t) {
    scene.world_from_camera =
        camera_looking({0.1 + 0.1 * unit(random), -0.6, 0.45 + 0.1 * unit(random)},
                       {0.02 * unit(random), 0.03, 0});
    const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens);
    const Track track = tracker->track(picture(scene, random, 200));
    if (!track.pose) continue;
    const glm::dmat4 d = glm::inverse(track.pose->world_from_camera) * scene.world_from_camera;
    // Only the diagonal: an upper bound is not what is sought, a scale is.
    const double x = d[3][0] * d[3][0] / track.pose->covariance[21] +
                     d[3][1] * d[3][1] / track.pose->covariance[28] +
                     d[3][2] * d[3][2] / track.pose->covariance[35];
    sum += x;
    ++counted;
  }
  ASSERT_GT(counted, trials / 2);
  // Three marginal chi-squares of one degree: mean 3; correlated, variance at most 9 * 2.
  EXPECT_LT(sum / counted, 3 + 3 * std::sqrt(18.0 / counted));
  EXPECT_GT(sum / counted, 0.3);
}

// At decimate 4 these tags are too small to be found: a lost frame must be searched in full.
TEST(Tracker, SearchesAtFullResolutionWhenLost) {
  TagScene scene = table();
  scene.world_from_camera = camera_looking({0.1, -0.9, 0.9}, {0.02, 0.03, 0});
  set::Tracking settings = settings_for(scene);
  settings.decimate = 4;
  std::mt19937 random(12);
  const auto tracker = make_apriltag_tracker(settings, scene.lens);
  for (int i = 0; i < 3; ++i) {
    Frame frame = picture(scene, random);
    frame.timestamp_ns = i * kFrameNs;
    EXPECT_EQ(tracker->track(frame).status, TrackStatus::tracked) << i;
  }
}

TEST(Tracker, PicturesOfAnySizeAndContent) {
  std::mt19937 random(13);
  std::uniform_int_distribution<int> byte(0, 255);
  for (const auto& [w, h] :
       {std::pair(1, 1), std::pair(2, 3), std::pair(7, 5), std::pair(15, 40), std::pair(16, 16),
        std::pair(17, 19), std::pair(33, 31), std::pair(101, 67), std::pair(400, 3)}) {
    for (double decimate : {1.0, 2.0, 3.0})
      for (PixelFormat format : {PixelFormat::rgb8, PixelFormat::gray8, PixelFormat::gray16}) {
        TagScene scene = table();
        scene.lens = test::plain_lens(w, h, 100);
        set::Tracking settings = settings_for(scene);
        settings.decimate = decimate;
        const auto tracker = make_apriltag_tracker(settings, scene.lens);
        Frame frame;
        frame.width = w, frame.height = h, frame.format = format;
        frame.bytes.resize(frame_bytes(format, w, h));
        for (int fill : {0, 255, -1}) {
          for (std::uint8_t& b : frame.bytes) b = std::uint8_t(fill < 0 ? byte(random) : fill);
          EXPECT_EQ(tracker->track(frame).status, TrackStatus::lost);
        }
      }
  }
}

TEST(Tracker, NoiseHoldsNoTags) {
  std::mt19937 random(14);
  std::uniform_int_distribution<int> byte(0, 255);
  TagScene scene = table();
  const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens);
  Frame frame = test::gray_frame(scene.lens.width, scene.lens.height);
  for (int i = 0; i < 5; ++i) {
    for (std::uint8_t& b : frame.bytes) b = std::uint8_t(byte(random));
    EXPECT_TRUE(tracker->track(frame).seen_tags.empty());
  }
}

}  // namespace previz::tracking::tracker_test
