// Live pictures are searched in parts: the plan of the parts, and what is found in them beside what
// the whole picture shows.
#include "daemon/core/tracking/search_plan.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "tests/support/tracking_fixture.hpp"

namespace previz::tracking::search_test {

bool holds(const Region& region, double x, double y, double half, int width, int height) {
  // Beside the picture's own border a region must reach 8 px beyond the tag.
  const double left = std::max(0.0, x - half - 8), right = std::min<double>(width, x + half + 8);
  const double top = std::max(0.0, y - half - 8), bottom = std::min<double>(height, y + half + 8);
  return region.x <= left && region.x + region.width >= right && region.y <= top &&
         region.y + region.height >= bottom;
}

TEST(SearchPlan, SweepsEveryTagOfUpTo64Pixels) {
  for (const auto& [w, h] : {std::pair(1920, 1080), {480, 360}, {641, 479}, {33, 17}}) {
    const int width = w, height = h;
    SearchPlan plan(width, height);
    std::vector<Region> swept;
    int coarse = 0;
    for (int i = 0; i < sweep_pictures; ++i) {
      const SearchStep step = plan.next({});
      coarse += step.coarse;
      swept.insert(swept.end(), step.regions.begin(), step.regions.end());
    }
    EXPECT_EQ(coarse, 1);
    for (int y = 0; y < height; ++y)
      EXPECT_TRUE(std::ranges::any_of(
          swept,
          [&](const Region& region) { return holds(region, width / 2.0, y, 32, width, height); }))
          << width << "x" << height << " row " << y;
    for (const Region& region : swept) EXPECT_EQ(region.width, width);
  }
}

TEST(SearchPlan, PartsLieApartOnTheThresholdsGrid) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> x(-40, 1960), y(-40, 1120), side(5, 200);
  for (int trial = 0; trial < 200; ++trial) {
    SearchPlan plan(1920, 1080);
    std::vector<ExpectedTag> expected;
    for (int i = 0; i < 12; ++i) {
      const glm::dvec2 low(x(random), y(random));
      expected.push_back({i, low, low + glm::dvec2(side(random), side(random)), true});
    }
    const std::vector<Region> regions = plan.next(expected).regions;
    for (std::size_t i = 0; i < regions.size(); ++i) {
      const Region& a = regions[i];
      EXPECT_EQ(a.x % 4, 0);
      EXPECT_EQ(a.y % 4, 0);
      EXPECT_GE(a.x, 0);
      EXPECT_GE(a.y, 0);
      EXPECT_GT(a.width, 0);
      EXPECT_GT(a.height, 0);
      EXPECT_LE(a.x + a.width, 1920);
      EXPECT_LE(a.y + a.height, 1080);
      for (std::size_t j = 0; j < i && i + 1 < regions.size(); ++j) {  // the last one is the strip
        const Region& b = regions[j];
        EXPECT_FALSE(a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height &&
                     b.y < a.y + a.height);
      }
    }
    for (const ExpectedTag& tag : expected) {
      const glm::dvec2 low = glm::clamp(tag.low, {0, 0}, {1919, 1079});
      const glm::dvec2 high = glm::clamp(tag.high, {0, 0}, {1919, 1079});
      EXPECT_TRUE(std::ranges::any_of(regions, [&](const Region& region) {
        return region.x <= low.x && region.y <= low.y && region.x + region.width > high.x &&
               region.y + region.height > high.y;
      }));
    }
  }
}

// The table with more on it: a small tag, and one that is not in the map.
TagScene full_table() {
  TagScene scene = table();
  scene.tags.push_back(flat_tag(3, 0.05, {0.05, 0.18, 0}, 1.1));
  scene.tags.push_back(flat_tag(7, 0.05, {-0.1, -0.12, 0}, 0.2));
  return scene;
}

set::Tracking map_of_full_table() {
  set::Tracking settings = settings_for(full_table());
  std::erase_if(settings.tags, [](const set::Tag& tag) { return tag.id == 7; });
  return settings;
}

Frame at_time(Frame frame, int index) {
  frame.timestamp_ns = index * kFrameNs;
  return frame;
}

TagScene seen_from(TagScene scene, double swing) {
  scene.world_from_camera = camera_looking(
      {0.1 + 0.2 * std::sin(swing), -0.4, 0.65 + 0.05 * std::cos(2 * swing)}, {0.02, 0.03, 0});
  return scene;
}

TEST(TagDetector, RefusesAPictureThatIsNotOfTheLensesSize) {
  std::mt19937 random(5);
  const TagScene scene = seen_from(full_table(), 0);
  PinholeIntrinsics other = scene.lens;
  other.width /= 2;
  TagDetector detector({}, other, {});
  const Frame frame = picture(scene, random);
  const std::string size = "x" + std::to_string(scene.lens.height);
  EXPECT_EQ(test::error_of([&] { detector.detect(frame, 1); }),
            "a picture has " + std::to_string(scene.lens.width) + size +
                " pixels, but its lens is calibrated for " + std::to_string(other.width) + size);
}

// The part is thresholded as the whole is, so the same border points are found; libapriltag fits
// its lines in single precision about another origin, and the refinement of the corners, which
// starts there, stops within 1e-3 px.
TEST(TagDetector, FindsInPartsWhatTheWholeShows) {
  std::mt19937 random(5);
  int compared = 0;
  for (const double swing : {0.0, 0.7, 1.4, 2.8}) {
    const TagScene scene = seen_from(full_table(), swing);
    const Frame frame = picture(scene, random);
    TagDetector detector({}, scene.lens, {});
    const std::vector<TagDetection> whole = detector.detect(frame, 1);
    ASSERT_EQ(whole.size(), scene.tags.size());
    for (const TagDetection& tag : whole) {
      glm::dvec2 low(HUGE_VAL), high(-HUGE_VAL);
      for (const glm::dvec2& corner : tag.corners) {
        low = glm::min(low, corner);
        high = glm::max(high, corner);
      }
      const glm::dvec2 margin = 0.3 * (high - low) + 8.0;
      SearchPlan plan(scene.lens.width, scene.lens.height);
      for (int i = 0; i < sweep_pictures; ++i) {
        const SearchStep step = plan.next({{tag.id, low - margin, high + margin, true}});
        const std::vector<TagDetection> parts = detector.detect(frame, step);
        const auto found = std::ranges::find(parts, tag.id, &TagDetection::id);
        ASSERT_NE(found, parts.end()) << tag.id;
        EXPECT_EQ(std::ranges::count(parts, tag.id, &TagDetection::id), 1);
        for (std::size_t k = 0; k < 4; ++k)
          EXPECT_LT(glm::distance(found->corners[k], tag.corners[k]), 2e-3) << tag.id;
        for (const TagDetection& other : parts)
          EXPECT_NE(std::ranges::find(whole, other.id, &TagDetection::id), whole.end());
        ++compared;
      }
    }
  }
  EXPECT_EQ(compared, 4 * 5 * sweep_pictures);
}

// A swinging camera: every picture shows the same tags of the map and the same pose as the whole.
TEST(SearchInParts, FollowsAsTheWholePictureDoes) {
  const set::Tracking settings = map_of_full_table();
  const TagScene scene = full_table();
  const auto parts = make_apriltag_tracker(settings, scene.lens, {}, Search::parts);
  std::mt19937 random(6);
  std::set<int> strangers;
  for (int i = 0; i < 24; ++i) {
    const Frame frame = at_time(picture(seen_from(scene, 0.15 * i), random), i);
    const auto alone = make_apriltag_tracker(settings, scene.lens);
    const Track whole = alone->track(frame), track = parts->track(frame);
    ASSERT_TRUE(track.pose) << i << ": " << track.reason;
    ASSERT_TRUE(whole.pose) << i;
    EXPECT_EQ(track.pose->tags, whole.pose->tags) << i;
    // A corner that is off by 2e-3 px moves the pose by far less than the 0.03 px of the model.
    EXPECT_LT(distance(track.pose->world_from_camera, whole.pose->world_from_camera),
              0.1 * translation_sigma(*whole.pose));
    for (const int id : track.seen_tags) {
      EXPECT_THAT(whole.seen_tags, Contains(id));
      if (id == 7 && i > 0) strangers.insert(i);
    }
  }
  EXPECT_GE(strangers.size(), 2u);  // the sweeps came by
}

// A tag of the map that comes into view is found in its first picture, any other within a sweep.
TEST(SearchInParts, FindsWhatEnters) {
  std::mt19937 random(8);
  for (const double size : {0.05, 0.2}) {
    TagScene scene = table();
    scene.lens = test::plain_lens(640, 480, 450);
    scene.world_from_camera = camera_looking({0.05, -0.4, 0.7}, {0.02, 0.03, 0});
    set::Tracking settings = settings_for(scene);
    const set::Tag newcomer = flat_tag(4, size, {0.08, 0.12 + size / 2, 0});
    settings.tags.push_back(newcomer);
    const set::Tag stranger = flat_tag(7, size, {-0.12 - size / 2, -0.12, 0});
    TagScene with = scene;
    with.tags.push_back(newcomer);
    with.tags.push_back(stranger);
    const Frame before = picture(scene, random), after = picture(with, random);
    const auto whole = make_apriltag_tracker(settings, scene.lens);
    ASSERT_EQ(whole->track(after).seen_tags, (std::vector<int>{0, 1, 2, 4, 7}));

    const auto tracker = make_apriltag_tracker(settings, scene.lens, {}, Search::parts);
    int index = 0;
    for (; index < 3; ++index) tracker->track(at_time(before, index));
    bool found = false;
    for (int i = 0; i < sweep_pictures; ++i, ++index) {
      const Track track = tracker->track(at_time(after, index));
      ASSERT_TRUE(track.pose);
      EXPECT_THAT(track.pose->tags, Contains(4)) << i;
      found |= std::ranges::count(track.seen_tags, 7) > 0;
    }
    EXPECT_TRUE(found) << size;
  }
}

// A camera that jumps is where parts may show none of its tags: where most are missing, the whole
// picture is searched at once, so that more than one of the three is found; the next frame has all.
TEST(SearchInParts, AJumpHasTheWholePictureSearched) {
  const TagScene scene = table();
  const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens, {}, Search::parts);
  std::mt19937 random(9);
  for (int i = 0; i < 8; ++i) {
    const Track track =
        tracker->track(at_time(picture(seen_from(scene, i / 4 % 2 * 1.5), random), i));
    ASSERT_TRUE(track.pose) << i << ": " << track.reason;
    EXPECT_GE(track.pose->tags.size(), i == 4 ? 2u : 3u) << i;
  }
}

// What was said about a carrier, the frame's size or a lost picture holds in parts, too.
TEST(SearchInParts, ACarrierThatReturnsIsFoundWithinASweep) {
  const TagScene scene = table();
  set::Tracking settings = settings_for(scene);
  settings.carriers = {{"tray", {flat_tag(10, 0.06, {0, 0, 0})}}};
  TagScene with = scene;
  with.tags.push_back(flat_tag(10, 0.06, {-0.02, -0.2, 0.05}));
  const auto tracker = make_apriltag_tracker(settings, scene.lens, {}, Search::parts);
  std::mt19937 random(10);
  int index = 0;
  for (; index < 3; ++index) {
    const Track track = tracker->track(at_time(picture(with, random), index));
    EXPECT_TRUE(track.carriers.at(0).pose) << index;
  }
  for (int i = 0; i < 2; ++i, ++index)
    EXPECT_FALSE(tracker->track(at_time(picture(scene, random), index)).carriers.at(0).pose);
  bool found = false;
  for (int i = 0; i < sweep_pictures; ++i, ++index)
    found |= tracker->track(at_time(picture(with, random), index)).carriers.at(0).pose.has_value();
  EXPECT_TRUE(found);
}

TEST(SearchInParts, NoiseHoldsNoTags) {
  std::mt19937 random(14);
  std::uniform_int_distribution<int> byte(0, 255);
  const TagScene scene = table();
  const auto tracker = make_apriltag_tracker(settings_for(scene), scene.lens, {}, Search::parts);
  for (int i = 0; i < 6; ++i) {
    Frame frame = at_time(picture(scene, random), i);
    if (i % 2 == 1)
      for (std::uint8_t& b : frame.bytes) b = std::uint8_t(byte(random));
    EXPECT_EQ(tracker->track(frame).seen_tags.size(), i % 2 == 1 ? 0u : 3u) << i;
  }
}

}  // namespace previz::tracking::search_test
