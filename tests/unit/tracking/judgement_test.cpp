// What the pictures of a take say against its tracking: tags of another kind, tags that are there
// twice, residuals that noise does not explain and their causes.
#include "daemon/core/tracking/pose_judgement.hpp"

#include <fmt/format.h>

#include <glm/gtc/matrix_transform.hpp>
#include <stop_token>

#include "daemon/core/set/tag_families.hpp"
#include "daemon/core/tracking/other_tags.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::judgement_test {

using Pictures = std::vector<FramePtr>;

FramePtr shared(Frame frame) {
  return std::make_shared<const Frame>(std::move(frame));
}

// Two pictures of the table, from two places.
Pictures pictures_of(TagScene scene, unsigned seed = 1) {
  std::mt19937 random(seed);
  Pictures pictures;
  for (const double x : {0.1, 0.0}) {
    scene.world_from_camera = camera_looking({x, -0.6, 0.45}, {0.02, 0.03, 0});
    pictures.push_back(shared(picture(scene, random)));
  }
  return pictures;
}

FramePtr changed(const FramePtr& frame, bool mirror, bool invert) {
  Frame copy = *frame;
  const auto width = std::size_t(copy.width);
  for (std::size_t y = 0; y < std::size_t(copy.height); ++y)
    for (std::size_t x = 0; x < width; ++x)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint8_t code = frame->bytes[3 * (y * width + (mirror ? width - 1 - x : x)) + c];
        copy.bytes[3 * (y * width + x) + c] = invert ? std::uint8_t(255 - code) : code;
      }
  return shared(std::move(copy));
}

Pictures changed(const Pictures& pictures, bool mirror, bool invert) {
  Pictures result;
  for (const FramePtr& frame : pictures) result.push_back(changed(frame, mirror, invert));
  return result;
}

// Every family that can be named in a set, but that itself.
TEST(OtherTags, OfEachFamilyAreNamedWithTheKey) {
  for (const std::string family : set::tag_families) {
    TagScene scene = table();
    scene.family = family;
    for (set::Tag& tag : scene.tags) tag.size_m = 0.06;
    const std::string other = family == "tag36h11" ? "tag25h9" : "tag36h11";
    const std::string words = other_tags(pictures_of(scene), other, {});
    EXPECT_THAT(words, HasSubstr("tags of " + family + ": tags 0, 1 and 2;"));
    EXPECT_THAT(words, HasSubstr("tracking.family = \"" + family + "\""));
    EXPECT_EQ(other_tags(pictures_of(scene), family, {}), "");
  }
}

TEST(OtherTags, MirroredAndNegativeOnesAreNamed) {
  for (const std::string family : {"tag36h11", "tag25h9", "tag16h5", "tagStandard41h12"}) {
    TagScene scene = table();
    scene.family = family;
    for (set::Tag& tag : scene.tags) tag.size_m = 0.06;
    const Pictures seen = pictures_of(scene);
    const std::string mirrored = other_tags(changed(seen, true, false), family, {});
    EXPECT_THAT(mirrored, HasSubstr("mirrored tags of " + family + ": tags 0, 1 and 2"));
    EXPECT_THAT(mirrored, Not(HasSubstr("white on black")));
    const std::string negative = other_tags(changed(seen, false, true), family, {});
    EXPECT_THAT(negative, HasSubstr("negative (white on black) tags of " + family));
    EXPECT_THAT(negative, Not(HasSubstr("mirrored")));
    EXPECT_THAT(other_tags(changed(seen, true, true), family, {}),
                HasSubstr("mirrored negative (white on black) tags of " + family));
  }
}

// A single tag of a large code is enough, one of 16 bits is not: a room's quads look like it.
TEST(OtherTags, AChanceFindIsNotNamed) {
  TagScene scene = table();
  scene.tags = {flat_tag(3, 0.08, {0, 0, 0})};
  scene.family = "tag25h9";
  EXPECT_THAT(other_tags(pictures_of(scene), "tag36h11", {}), HasSubstr("tags of tag25h9: tag 3"));
  scene.family = "tag16h5";
  EXPECT_EQ(other_tags(pictures_of(scene), "tag36h11", {}), "");
  // In one of two pictures.
  scene.family = "tag25h9";
  Pictures pictures = pictures_of(scene);
  scene.tags.clear();
  pictures[1] = pictures_of(scene)[1];
  EXPECT_EQ(other_tags(pictures, "tag36h11", {}), "");
  EXPECT_NE(other_tags({pictures[0]}, "tag36h11", {}), "");
  std::mt19937 random(5);
  std::uniform_int_distribution<int> byte(0, 255);
  Frame noise = *pictures[1];
  for (std::uint8_t& b : noise.bytes) b = std::uint8_t(byte(random));
  EXPECT_EQ(other_tags({shared(noise)}, "tag36h11", {}), "");
  EXPECT_EQ(other_tags({}, "tag36h11", {}), "");
}

glm::dmat4 camera_of(int frame) {
  return camera_looking({0.1 - 0.05 * frame, -0.6, 0.45}, {0.02, 0.03, 0});
}

// The doubts about frames of what is `seen`, by a set that has it as `believed`.
std::vector<std::string> doubts_about(const TagScene& believed, TagScene seen, int frames = 3) {
  ObserverCalibration camera;
  camera.intrinsics = believed.lens;
  const set::Tracking settings = settings_for(believed);
  const auto tracker = make_apriltag_tracker(settings, believed.lens);
  PoseJudgement judgement(settings, camera);
  std::mt19937 random(7);
  for (int i = 0; i < frames; ++i) {
    seen.world_from_camera = camera_of(i);
    Frame frame = picture(seen, random);
    frame.timestamp_ns = i * kFrameNs;
    const FramePtr shown = shared(std::move(frame));
    judgement.add(shown, tracker->track(*shown));
  }
  return judgement.doubts();
}

TagScene wide_table() {
  TagScene scene = table();
  scene.tags.push_back(flat_tag(3, 0.08, {0.05, 0.2, 0}, 1.0));
  scene.tags.push_back(flat_tag(4, 0.08, {-0.2, -0.1, 0}, 0.2));
  return scene;
}

// A tag at these corners, with noise of the covariance that it has.
TagObservation observed(const set::Tag& tag, CornerPixels corners, double noise_px,
                        std::mt19937& random) {
  std::normal_distribution<double> noise;
  for (glm::dvec2& corner : corners) corner += noise_px * glm::dvec2(noise(random), noise(random));
  TagObservation seen{tag.id, tag.size_m, tag.world_from_tag, corners, {}};
  for (std::size_t i = 0; i < 8; ++i) seen.covariance[9 * i] = noise_px * noise_px;
  return seen;
}

Track track_of(std::vector<TagObservation> tags, const glm::dmat4& world_from_camera) {
  Track track;
  track.status = TrackStatus::tracked;
  track.pose.emplace().world_from_camera = world_from_camera;
  for (const TagObservation& tag : tags) {
    track.seen_tags.push_back(tag.id);
    track.pose->tags.push_back(tag.id);
  }
  track.observations = std::move(tags);
  return track;
}

// Returns how far off, in percent, the factor of sizes or of the focal length of what is `seen` may
// be said to be: five standard deviations, and half of the last digit. The pictures' corners are
// off by less than kCornerFloorPx (their messages say "0.00 px remain"). Of corners of this
// deviation, a factor that is wrong by a little, with poses that follow it, leaves the square of
// its own deviations as chi-square.
double tolerated_percent(TagScene seen, bool of_sizes) {
  constexpr double little = 1e-3;
  double chi_square = 0;
  std::mt19937 random;
  for (int i = 0; i < 3; ++i) {
    seen.world_from_camera = camera_of(i);
    std::vector<TagObservation> tags;
    for (const set::Tag& tag : seen.tags) {
      tags.push_back(observed(tag, test::exact_corners(seen, tag), 0, random));
      if (of_sizes) tags.back().size_m *= 1 + little;
    }
    PinholeIntrinsics lens = seen.lens;
    if (!of_sizes) lens.fx *= 1 + little, lens.fy *= 1 + little;
    chi_square += refitted_pose(tags, lens, camera_from_world(seen.world_from_camera))->chi_square;
  }
  return 100 * 5 * little / std::sqrt(chi_square) + 0.05;
}

// Returns the number that follows these words, NaN if it is not there.
double number_after(const std::string& text, const std::string& words) {
  const std::size_t at = text.find(words);
  return at == std::string::npos ? NAN : std::strtod(text.c_str() + at + words.size(), nullptr);
}

TEST(PoseJudgement, HasNoDoubtAboutWhatIsRight) {
  EXPECT_THAT(doubts_about(table(), table()), IsEmpty());
  EXPECT_THAT(doubts_about(wide_table(), wide_table()), IsEmpty());
}

TEST(PoseJudgement, SaysWhatIsThereInPlaceOfTags) {
  TagScene other = table();
  other.family = "tag25h9";
  EXPECT_THAT(doubts_about(table(), other),
              ElementsAre(HasSubstr("no tag of tag36h11 in any picture: the pictures hold tags of "
                                    "tag25h9: tags 0, 1 and 2")));
}

TEST(PoseJudgement, NamesATagThatIsThereTwice) {
  TagScene seen = wide_table();
  seen.tags.push_back(flat_tag(2, 0.08, {0.2, 0.12, 0}));
  EXPECT_THAT(doubts_about(wide_table(), seen),
              ElementsAre(HasSubstr("tag 2 is there twice in 3 frames: printed twice")));
}

TEST(PoseJudgement, FindsTheScaleOfPrints) {
  for (const double scale : {0.95, 0.97, 1.04, 0.9}) {
    TagScene seen = wide_table();
    for (set::Tag& tag : seen.tags) tag.size_m *= scale;
    const auto doubts = doubts_about(wide_table(), seen);
    ASSERT_EQ(doubts.size(), 1u) << scale;
    EXPECT_NEAR(number_after(doubts[0], "all tags measure "), 100 * scale,
                tolerated_percent(seen, true))
        << doubts[0];
  }
}

TEST(PoseJudgement, FindsAnotherFocalLength) {
  for (const double factor : {0.94, 1.05, 1.1}) {
    TagScene seen = wide_table();
    seen.lens.fx *= factor;
    seen.lens.fy *= factor;
    const auto doubts = doubts_about(wide_table(), seen);
    ASSERT_EQ(doubts.size(), 1u) << factor;
    EXPECT_THAT(doubts[0], HasSubstr(factor > 1 ? "% too small" : "% too large")) << doubts[0];
    EXPECT_NEAR(number_after(doubts[0], "fx and fy are "), 100 * std::abs(1 - 1 / factor),
                tolerated_percent(seen, false))
        << doubts[0];
  }
}

// The size of a tag whose border lies inside is that of its border. apriltag_ros #116 took the
// outer edge, of 9 cells; tag36h11 has 10 with its white ones.
TEST(PoseJudgement, NamesASizeByTheOuterEdge) {
  const std::pair<const char*, double> families[] = {{"tagStandard41h12", 5.0 / 9},
                                                     {"tagStandard52h13", 6.0 / 10},
                                                     {"tagCircle21h7", 5.0 / 9},
                                                     {"tag36h11", 8.0 / 10}};
  for (const auto& [family, share] : families) {
    TagScene believed = wide_table();
    believed.family = family;
    TagScene seen = believed;
    for (set::Tag& tag : seen.tags) tag.size_m *= share;
    const auto doubts = doubts_about(believed, seen, 1);
    ASSERT_EQ(doubts.size(), 1u) << family;
    EXPECT_THAT(doubts[0], HasSubstr("tags disagree in 1 of 1 frame,"));
    EXPECT_THAT(doubts[0], HasSubstr("tag 0: " + fmt::format("{:.2g}", 0.08 * share))) << doubts[0];
    EXPECT_THAT(doubts[0], HasSubstr("size_m is the side of the inner square")) << doubts[0];
  }
}

// A change to one tag, and the words for it.
TEST(PoseJudgement, SaysWhyATagIsNotUsed) {
  const TagScene believed = wide_table();
  const auto doubt = [&](const std::function<void(std::vector<set::Tag>&)>& change) {
    TagScene seen = believed;
    change(seen.tags);
    const auto doubts = doubts_about(believed, seen, 2);
    EXPECT_EQ(doubts.size(), 1u);
    return doubts.empty() ? "" : doubts[0];
  };
  const std::string moved = doubt([](auto& tags) { tags[3].world_from_tag[3].x += 0.03; });
  EXPECT_THAT(moved, HasSubstr("tag 3 is "));
  EXPECT_THAT(moved, HasSubstr("`previz calibrate tags TAKE`"));
  // A corner's kCornerFloorPx is 0.05 mm across the view, at 0.75 m by 450 px of focal length, and
  // more than what four tags leave of the camera's pose: five of it, and half of the last digit.
  EXPECT_NEAR(number_after(moved, "tag 3 is "), 30, 0.3) << moved;
  EXPECT_NEAR(number_after(moved, "(x "), 30, 0.3) << moved;
  const std::string turned = doubt([](auto& tags) {
    tags[3] = flat_tag(3, 0.08, {0.05, 0.2, 0}, 1.0 + 0.5);
  });
  // At the shortest half side, 14 px (of 48 px, seen at 37 degrees), kCornerFloorPx of 8 corners is
  // 0.043 degrees: five of it, and half of the last digit.
  EXPECT_NEAR(number_after(turned, "turned by "), 0.5 * 180 / std::numbers::pi, 0.3) << turned;
  EXPECT_THAT(turned, Not(HasSubstr("mm off")));
  EXPECT_THAT(doubt([](auto& tags) { tags[3].size_m *= 0.9; }), HasSubstr("tag 3 measures 7"));
}

TEST(PoseJudgement, NamesTagsThatAreExchanged) {
  const TagScene believed = wide_table();
  TagScene seen = believed;
  std::swap(seen.tags[3].id, seen.tags[4].id);
  EXPECT_THAT(doubts_about(believed, seen),
              ElementsAre(HasSubstr("tag 3 is where the set has tag 4: exchange"),
                          HasSubstr("tag 4 is where the set has tag 3: exchange")));
}

// Tracks a picture in which tag 1 was moved.
Track of_moved(Tracker& tracker, double moved_m, std::mt19937& random, std::int64_t time_ns = 0) {
  TagScene seen = table();
  seen.tags[1].world_from_tag[3].x += moved_m;
  Frame frame = picture(seen, random);
  frame.timestamp_ns = time_ns;
  return tracker.track(frame);
}

TEST(TagTrust, NamesTheOneThatTheOthersContradict) {
  const TagScene believed = table();
  for (const double moved_m : {0.0, 0.0002, 0.005, 0.01, 0.04}) {
    const auto tracker = make_apriltag_tracker(settings_for(believed), believed.lens);
    TagTrust trust(settings_for(believed), believed.lens);
    std::mt19937 random(3);
    for (int i = 0; i < 2; ++i) trust.add(of_moved(*tracker, moved_m, random, i * kFrameNs));
    if (moved_m < 0.001) {
      EXPECT_THAT(trust.moved(), IsEmpty()) << moved_m;
      continue;
    }
    EXPECT_THAT(trust.moved(2), ElementsAre(1)) << moved_m;
    EXPECT_THAT(trust.moved(3), IsEmpty()) << moved_m;
    // The tolerance is that of SaysWhyATagIsNotUsed, with two tags that give the pose.
    EXPECT_NEAR(number_after(trust.words(1), "is "), 1000 * moved_m, 0.5) << trust.words(1);
    EXPECT_THAT(trust.words(1), HasSubstr("`previz calibrate tags TAKE`"));
  }
}

TEST(TagTrust, OfTwoTagsNamesNeither) {
  TagScene believed = table();
  believed.tags.pop_back();
  TagScene seen = believed;
  seen.tags[1].world_from_tag[3].x += 0.01;
  TagTrust trust(settings_for(believed), believed.lens);
  for (unsigned i = 0; i < 3; ++i) trust.add(track_once(settings_for(believed), seen, i));
  EXPECT_THAT(trust.moved(), IsEmpty());
  EXPECT_THAT(doubts_about(believed, seen),
              ElementsAre(HasSubstr("tags 0 and 1 do not stand as the set has them")));
}

TEST(TagTrust, ATagThatIsBackIsTrustedAgain) {
  constexpr int memory = 8;
  const TagScene believed = table();
  const auto tracker = make_apriltag_tracker(settings_for(believed), believed.lens);
  TagTrust trust(settings_for(believed), believed.lens, memory);
  std::mt19937 random(3);
  std::int64_t time_ns = 0;
  for (int i = 0; i < 2 * memory; ++i)
    trust.add(of_moved(*tracker, 0.01, random, time_ns += kFrameNs));
  EXPECT_THAT(trust.moved(), ElementsAre(1));
  tracker->leave_out(trust.moved());
  for (int i = 0; i < memory; ++i) {
    const Track track = of_moved(*tracker, 0, random, time_ns += kFrameNs);
    ASSERT_TRUE(track.pose);
    EXPECT_THAT(track.pose->tags, ElementsAre(0, 2));
    trust.add(track);
  }
  EXPECT_THAT(trust.moved(), IsEmpty());
}

TEST(TagTrust, ATagThatIsLeftOutGivesNoPoseByItself) {
  const TagScene believed = table();
  TagScene seen = believed;
  seen.tags = {seen.tags[1]};
  std::mt19937 random(3);
  const auto tracker = make_apriltag_tracker(settings_for(believed), believed.lens);
  tracker->leave_out({1});
  const Track track = tracker->track(picture(seen, random));
  EXPECT_FALSE(track.pose);
  EXPECT_THAT(track.reason, HasSubstr("tag 1: not where the set file says"));
}

TEST(PoseJudgement, SaysThatATagIsCutByTheBorder) {
  const TagScene seen = wide_table();
  ObserverCalibration camera;
  camera.intrinsics = seen.lens;
  PoseJudgement judgement(settings_for(seen), camera);
  Track track;
  track.pose.emplace();
  track.seen_tags = {4};
  track.unusable = {{4, "cut by the picture's border"}};
  for (int i = 0; i < 3; ++i) judgement.add(nullptr, track);
  EXPECT_EQ(judgement.why_unusable(4), "cut by the picture's border in 3 frames");
  EXPECT_EQ(judgement.why_unusable(3), "");
  EXPECT_THAT(judgement.doubts(), IsEmpty());
}

// The scan looks at few of the tags; what is said is of all of them.
TEST(PoseJudgement, OfManyTagsFindsTheFactorAndStops) {
  TagScene believed = table();
  believed.tags.clear();
  for (int i = 0; i < 60; ++i) {
    const int column = i % 10, row = i / 10;
    believed.tags.push_back(
        flat_tag(i, 0.04, {0.06 * column - 0.27, 0.06 * row - 0.15, 0}, 0.3 * i));
  }
  for (const bool is_lost : {false, true}) {
    TagScene seen = believed;
    for (set::Tag& tag : seen.tags) tag.size_m *= is_lost ? 0.8 : 0.97;
    ObserverCalibration camera;
    camera.intrinsics = seen.lens;
    PoseJudgement judgement(settings_for(believed), camera);
    std::mt19937 random(11);
    for (int i = 0; i < 8; ++i) {
      seen.world_from_camera = camera_looking({0.2 - 0.05 * i, -0.5, 0.6}, {0, 0, 0});
      std::vector<TagObservation> tags;
      for (std::size_t k = 0; k < seen.tags.size(); ++k)
        tags.push_back(
            observed(believed.tags[k], test::exact_corners(seen, seen.tags[k]), 0.05, random));
      Track track = track_of(std::move(tags), seen.world_from_camera);
      if (is_lost) track.pose.reset();
      judgement.add(nullptr, track);
    }
    const auto doubts = judgement.doubts();
    ASSERT_EQ(doubts.size(), 1u);
    EXPECT_THAT(doubts[0], HasSubstr(is_lost ? "all tags measure 80.0 % of their size_m"
                                             : "all tags measure 97.0 % of their size_m"));
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THAT(judgement.doubts(stop.get_token()), IsEmpty());
  }
}

// Corners at the projections by a pose of each row, with noise of the covariance that they have.
TEST(PoseJudgement, FindsRowsThatDoNotFitOnePose) {
  constexpr double noise_px = 0.05;
  const TagScene scene = wide_table();
  for (const double turn : {0.0, 0.04}) {
    const auto corner_at = [&](const set::Tag& tag, std::size_t k, double time) {
      TagScene then = scene;
      then.world_from_camera *= glm::rotate(glm::dmat4(1), turn * time, glm::dvec3(0, 1, 0));
      return test::exact_corners(then, tag)[k];
    };
    std::mt19937 random(3);
    std::vector<TagObservation> tags, exact;
    double moved_px = 0;  // while the height is read, mean of the corners
    for (const set::Tag& tag : scene.tags) {
      CornerPixels corners = test::exact_corners(scene, tag);
      for (std::size_t k = 0; k < 4; ++k) {
        for (int i = 0; i < 20; ++i)  // the row that sees it sees it from elsewhere
          corners[k] = corner_at(tag, k, (corners[k].y + 0.5) / scene.lens.height - 0.5);
        moved_px += glm::distance(corner_at(tag, k, -0.5), corner_at(tag, k, 0.5)) /
                    (4.0 * double(scene.tags.size()));
      }
      tags.push_back(observed(tag, corners, noise_px, random));
      exact.push_back(tags.back());
      exact.back().corners = corners;
    }
    ObserverCalibration camera;
    camera.intrinsics = scene.lens;
    PoseJudgement judgement(settings_for(scene), camera);
    judgement.add(nullptr, track_of(tags, scene.world_from_camera));
    const auto doubts = judgement.doubts();
    if (turn == 0) {
      EXPECT_THAT(doubts, IsEmpty());
      continue;
    }
    ASSERT_EQ(doubts.size(), 1u);
    EXPECT_THAT(doubts[0], HasSubstr("the rows of a picture do not fit one pose"));
    // One pose leaves of exact corners, as chi-square, the square of the motion in its deviations.
    const auto still = refitted_pose(exact, scene.lens, camera_from_world(scene.world_from_camera));
    ASSERT_TRUE(still);
    const double deviation_px = moved_px / std::sqrt(still->chi_square);
    EXPECT_NEAR(number_after(doubts[0], "the tags move by "), moved_px, 5 * deviation_px + 0.05);
  }
}

}  // namespace previz::tracking::judgement_test
