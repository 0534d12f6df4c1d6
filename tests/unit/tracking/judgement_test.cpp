// What the pictures of a take say against its tracking: tags of another kind, tags that are there
// twice, residuals that noise does not explain and their causes.
#include "daemon/tracking/pose_judgement.hpp"

#include <fmt/format.h>

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/set/tag_families.hpp"
#include "daemon/tracking/other_tags.hpp"
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

// The doubts about frames of what is `seen`, by a set that has it as `believed`.
std::vector<std::string> doubts_about(const TagScene& believed, TagScene seen, int frames = 3) {
  ObserverCalibration camera;
  camera.intrinsics = believed.lens;
  const set::Tracking settings = settings_for(believed);
  const auto tracker = make_apriltag_tracker(settings, believed.lens);
  PoseJudgement judgement(settings, camera);
  std::mt19937 random(7);
  for (int i = 0; i < frames; ++i) {
    seen.world_from_camera = camera_looking({0.1 - 0.05 * i, -0.6, 0.45}, {0.02, 0.03, 0});
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
    double percent = 0;
    const std::string words =
        doubts[0].substr(std::min(doubts[0].size(), doubts[0].find("all tags")));
    ASSERT_EQ(std::sscanf(words.c_str(), "all tags measure %lf %%", &percent), 1) << doubts[0];
    EXPECT_NEAR(percent, 100 * scale, 0.3) << doubts[0];
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
    EXPECT_THAT(doubts[0], HasSubstr("tags disagree in 1 of 1 frames"));
    EXPECT_THAT(doubts[0], HasSubstr("tag 0: " + fmt::format("{:.2g}", 0.08 * share))) << doubts[0];
    EXPECT_THAT(doubts[0], HasSubstr("size_m is the side of the inner square")) << doubts[0];
  }
}

// What is done to one tag, and what is said of it.
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
  EXPECT_THAT(moved,
              HasSubstr("tag 3 is in 2 tracked frames and used for the camera in 0: it is "));
  double mm = 0, x = 0;
  ASSERT_EQ(std::sscanf(moved.substr(moved.find(": it is")).c_str(), ": it is %lf mm off (x %lf",
                        &mm, &x),
            2)
      << moved;
  EXPECT_NEAR(mm, 30, 1);
  EXPECT_NEAR(x, 30, 1);
  const std::string turned = doubt([](auto& tags) {
    tags[3] = flat_tag(3, 0.08, {0.05, 0.2, 0}, 1.0 + 0.5);
  });
  double degrees = 0;
  ASSERT_EQ(std::sscanf(turned.substr(turned.find("turned by")).c_str(), "turned by %lf", &degrees),
            1)
      << turned;
  EXPECT_NEAR(degrees, 0.5 * 180 / 3.14159, 1);
  EXPECT_THAT(turned, Not(HasSubstr("mm off")));
  EXPECT_THAT(doubt([](auto& tags) { tags[3].size_m *= 0.9; }), HasSubstr("it measures 7"));
}

TEST(PoseJudgement, NamesTagsThatAreExchanged) {
  const TagScene believed = wide_table();
  TagScene seen = believed;
  std::swap(seen.tags[3].id, seen.tags[4].id);
  EXPECT_THAT(doubts_about(believed, seen),
              ElementsAre(HasSubstr("it is where the set has tag 4: exchange"),
                          HasSubstr("it is where the set has tag 3: exchange")));
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

// Corners at the projections by a pose of each row, with noise of the covariance that they have.
TEST(PoseJudgement, FindsRowsThatDoNotFitOnePose) {
  const TagScene scene = wide_table();
  for (const double turn : {0.0, 0.04}) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, 0.05);
    Track track;
    track.status = TrackStatus::tracked;
    track.pose.emplace().world_from_camera = scene.world_from_camera;
    for (const set::Tag& tag : scene.tags) {
      TagObservation seen{tag.id, tag.size_m, tag.world_from_tag, {}, {}};
      for (std::size_t k = 0; k < 4; ++k) {
        TagScene then = scene;
        glm::dvec2 corner = test::exact_corners(scene, tag)[k];
        for (int i = 0; i < 20; ++i) {  // the row that sees it sees it from elsewhere
          then.world_from_camera =
              scene.world_from_camera * glm::rotate(glm::dmat4(1),
                                                    turn * (corner.y / scene.lens.height - 0.5),
                                                    glm::dvec3(0, 1, 0));
          corner = test::exact_corners(then, tag)[k];
        }
        seen.corners[k] = corner + glm::dvec2(noise(random), noise(random));
      }
      for (std::size_t i = 0; i < 8; ++i) seen.covariance[9 * i] = 0.05 * 0.05;
      track.observations.push_back(seen);
      track.seen_tags.push_back(tag.id);
      track.pose->tags.push_back(tag.id);
    }
    ObserverCalibration camera;
    camera.intrinsics = scene.lens;
    PoseJudgement judgement(settings_for(scene), camera);
    judgement.add(nullptr, track);
    const auto doubts = judgement.doubts();
    if (turn == 0) {
      EXPECT_THAT(doubts, IsEmpty());
      continue;
    }
    ASSERT_EQ(doubts.size(), 1u);
    EXPECT_THAT(doubts[0], HasSubstr("the rows of a picture do not fit one pose"));
    // 450 px of focal length times 0.04 rad, more beside the centre of a wide picture.
    double moved = 0;
    const std::string words = doubts[0].substr(doubts[0].find("the tags move by"));
    ASSERT_EQ(std::sscanf(words.c_str(), "the tags move by %lf", &moved), 1);
    EXPECT_NEAR(moved, 450 * 0.04, 2.5);
  }
}

}  // namespace previz::tracking::judgement_test
