// Corners that the crew marks: which is next, where they are, and what the crew is told.
#include "daemon/core/live/marking.hpp"

#include <glm/geometric.hpp>

#include "daemon/rig/controls.hpp"
#include "daemon/rig/marking_lines.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::marking_test {

constexpr int width = 640, height = 480;
constexpr double focal_px = 600;

// The cross on a point, of a camera at `eye` that is turned aside from it by so many pixels.
live::Aim aim(const glm::dvec3& eye, const glm::dvec3& at, double off_px = 0,
              std::int64_t when = 1) {
  const glm::dvec3 towards = glm::normalize(at - eye);
  const glm::dvec3 aside = glm::normalize(glm::cross(towards, glm::dvec3(0, 0, 1)));
  return {when,
          {319.5, 239.5},
          focal_px,
          tracking::Ray{eye, glm::normalize(towards + off_px / focal_px * aside)}};
}

const glm::dvec3 corner{0.1, 0.2, 0.3}, left{-1, -1, 1}, right{1, -1, 1}, above{0, 0, 2};

TEST(Marking, FindsACornerWhereItsRaysMeet) {
  live::Marking marking;
  marking.mark(aim(left, corner));
  EXPECT_FALSE(marking.last()->place());
  EXPECT_EQ(live::Marking::words_of(*marking.last()), "marked once");
  marking.next_box();  // there and back
  marking.next_box();
  marking.mark(aim(right, corner));
  const auto place = marking.boxes()[0][0].place();
  ASSERT_TRUE(place);
  EXPECT_LT(glm::distance(*place, corner), 1e-12);
  EXPECT_EQ(live::Marking::words_of(*marking.last()), "marked twice, within 0.0 px");
}

// Two sides of a table; corners of a box on it are marked from each.
live::Marking marked_from_two_sides(const std::vector<glm::dvec3>& corners) {
  live::Marking marking;
  for (const glm::dvec3& eye : {left, right})
    for (const glm::dvec3& at : corners) marking.mark(aim(eye, at));
  return marking;
}

TEST(Marking, SaysWhenABoxIsCompleteAndWhetherItsCornersAreInOrder) {
  const glm::dvec3 x(0.1, 0, 0), y(0, 0.1, 0);
  EXPECT_EQ(marked_from_two_sides({corner, corner + x, corner + x + y}).words_of_box(),
            "box 1 is complete");
  EXPECT_EQ(marked_from_two_sides({corner, corner + x + y, corner + x}).words_of_box(),
            "box 1: its corners are not in order around; unmark, and mark them in order");
  EXPECT_EQ(marked_from_two_sides({corner, corner + x}).words_of_box(), "");
  EXPECT_EQ(live::Marking().words_of_box(), "");
}

// From the left the left corner, from the right the right one: rays that part meet behind the
// cameras.
TEST(Marking, TakesNoTwoCornersForOne) {
  live::MarkedCorner two;
  for (const live::Aim& a :
       {aim(left, left + glm::dvec3(-0.3, 1, 0)), aim(right, right + glm::dvec3(0.3, 1, 0))})
    two.marks.push_back({1, *a.ray, a.px_per_rad});
  EXPECT_FALSE(two.place());
  EXPECT_EQ(live::Marking::words_of(two),
            "its marks are of different corners; unmark, and mark one of them");
}

TEST(Marking, GoesAroundTheCornersAndOnToOtherBoxes) {
  live::Marking marking;
  std::vector<std::string> marked;
  for (int i = 0; i < 4; ++i) marked.push_back(marking.mark(aim(left, corner)).point);
  EXPECT_THAT(marked, testing::ElementsAre("box 1 corner 1", "box 1 corner 2", "box 1 corner 3",
                                           "box 1 corner 1"));
  EXPECT_EQ(marking.selected(), "box 1 corner 2");
  marking.next_box();
  EXPECT_EQ(marking.selected(), "box 2 corner 1");
  marking.next_box();  // the second has no mark, so that there is no third
  EXPECT_EQ(marking.selected(), "box 1 corner 1");
  marking.next_box();
  marking.next_corner();
  EXPECT_EQ(marking.mark(aim(left, corner)).point, "box 2 corner 2");
  marking.next_box();
  EXPECT_EQ(marking.selected(), "box 3 corner 1");
}

TEST(Marking, WithdrawsMarksFromTheLastOneOn) {
  live::Marking marking;
  EXPECT_FALSE(marking.withdraw());
  marking.mark(aim(left, corner, 0, 7));
  marking.mark(aim(left, corner, 0, 8));
  const session::MarkEvent second{8, "box 1 corner 2", {}, true},
      first{7, "box 1 corner 1", {}, true};
  EXPECT_EQ(marking.withdraw(), second);
  EXPECT_EQ(marking.selected(), "box 1 corner 2");
  EXPECT_EQ(marking.withdraw(), first);
  EXPECT_EQ(marking.selected(), "box 1 corner 1");
  EXPECT_EQ(marking, live::Marking());
}

// Two rays that miss each other are each half of that away from where they are nearest.
TEST(Marking, SaysWhatIsWrongWithACorner) {
  live::MarkedCorner apart;
  for (const live::Aim& a : {aim(left, corner, -20), aim(right, corner), aim(above, corner)})
    apart.marks.push_back({1, *a.ray, a.px_per_rad});
  EXPECT_THAT(live::Marking::words_of(apart),
              testing::MatchesRegex(
                  "its marks miss each other by [0-9]+ px; unmark, and aim at the same spot"));
  live::MarkedCorner near;
  for (const glm::dvec3& eye : {left, left + glm::dvec3(0.05, 0, 0)})
    near.marks.push_back({1, *aim(eye, corner).ray, focal_px});
  EXPECT_EQ(live::Marking::words_of(near),
            "marked twice from one place; go aside and mark it again");
  live::MarkedCorner same;
  for (int i = 0; i < 2; ++i) same.marks.push_back({1, *aim(left, corner).ray, focal_px});
  EXPECT_FALSE(same.place());
}

TEST(Marking, IsAimedWithTheMiddleOfThePictureIfTagsShowTheCamera) {
  const PinholeIntrinsics lens = test::plain_lens(width, height, focal_px);
  pipeline::Shot shot;
  Frame frame;
  frame.timestamp_ns = 5;
  shot.frame = std::make_shared<Frame>(frame);
  EXPECT_FALSE(live::aim_of(shot, lens).ray);
  shot.track.pose.emplace();
  shot.track.pose->world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {1, 2, 3, 1}};
  EXPECT_FALSE(live::aim_of(shot, lens).ray);  // another tracker's
  shot.track.pose->tags = {3};
  const live::Aim middle = live::aim_of(shot, lens);
  ASSERT_TRUE(middle.ray);
  EXPECT_EQ(middle.timestamp_ns, 5);
  EXPECT_EQ(middle.px, glm::dvec2(319.5, 239.5));
  EXPECT_EQ(middle.ray->origin, glm::dvec3(1, 2, 3));
  // plain_lens() has its principal point in the middle.
  EXPECT_LT(glm::distance(middle.ray->direction, glm::dvec3(0, 0, -1)), 1e-9);
}

// A camera at `left` or `right` that looks at the corner.
glm::dmat4 looking_from(const glm::dvec3& eye) {
  const glm::dvec3 z = glm::normalize(corner - eye);
  const glm::dvec3 x = glm::normalize(glm::cross(z, glm::dvec3(0, 0, 1)));
  return {glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), glm::dvec4(eye, 1)};
}

bool has_word(const output::GuidePage& page, const std::string& text, const glm::dvec2& at) {
  return std::ranges::any_of(page.words, [&](const output::GuideWord& word) {
    return word.text == text && glm::distance(word.at, at) < 40;
  });
}

TEST(MarkingLines, LeaveTheMiddleFreeAndNameTheCorner) {
  const PinholeIntrinsics lens = test::plain_lens(width, height, focal_px);
  const output::GuidePage page = marking_lines({}, lens, {});
  EXPECT_EQ(page.width, width);
  ASSERT_EQ(page.lines.size(), 4u);
  const glm::dvec2 middle(319.5, 239.5);
  for (const output::GuideLine& line : page.lines) {
    EXPECT_GT(glm::distance(line.a, middle), 4);
    EXPECT_EQ(line.kind, output::GuideKind::mark);
  }
  EXPECT_TRUE(has_word(page, "box 1 corner 1", middle));
}

TEST(MarkingLines, ShowCornersThatAreFoundAndTheRayOfOneThatIsMarkedOnce) {
  const PinholeIntrinsics lens = test::plain_lens(width, height, focal_px);
  live::Marking marking;
  marking.mark(aim(left, corner));
  marking.next_box();
  marking.next_box();  // the first corner again
  const output::GuidePage once = marking_lines(marking, lens, looking_from(right));
  EXPECT_GT(once.lines.size(), 4u + 5u);  // the ray crosses the picture in many segments
  marking.mark(aim(right, corner));
  const output::GuidePage found = marking_lines(marking, lens, looking_from(right));
  EXPECT_EQ(found.lines.size(), 4u + 2u);
  EXPECT_TRUE(has_word(found, "1.1", {319.5, 239.5}));
  // A corner out of the picture has no cross there.
  EXPECT_EQ(marking_lines(marking, lens, looking_from(2.0 * corner - right)).words.size(), 2u);
}

struct Desk {
  set::Set set = {};
  Controls controls{set};
  Outcome operator()(const char* action) { return controls.perform(*set::find_action(action)); }
};

TEST(MarkingControls, MarkOnlyWhereAMarkIsKeptAndMeansSomething) {
  Desk desk;
  EXPECT_EQ(desk("mark").said, "aim the cross at box 1 corner 1");
  EXPECT_TRUE(desk.controls.look().marking.is_on);
  EXPECT_EQ(desk("mark").said, "marks are kept in a take; start one with record, then mark");
  desk("record");
  EXPECT_EQ(desk("mark").said, "not marked: the picture was not live; aim and mark again");
  desk.controls.use_aim(live::Aim{});
  EXPECT_EQ(desk("mark").said, "not marked: no tag in the picture shows where the camera is");
  desk.controls.use_aim(aim(left, corner, 0, 5));
  desk.controls.use_take({.name = "12A_take001"});
  const Outcome marked = desk("mark");
  EXPECT_EQ(marked.said, "box 1 corner 1: marked once");
  EXPECT_EQ(marked.mark, (session::MarkEvent{5, "box 1 corner 1", {319.5, 239.5}}));
  EXPECT_EQ(desk("next_corner").said, "mark box 1 corner 3");
  EXPECT_EQ(desk("next_box").said, "mark box 2 corner 1, of a new box");
  const Outcome withdrawn = desk("unmark");
  EXPECT_EQ(withdrawn.said, "box 1 corner 1: mark withdrawn, not marked");
  EXPECT_EQ(withdrawn.mark, (session::MarkEvent{5, "box 1 corner 1", {}, true}));
  EXPECT_EQ(desk("unmark").said, "no corner is marked");
  desk.controls.happened(live::Event::good_frame);
  desk("refine");
  EXPECT_EQ(desk("mark").said, "only the live picture can be marked");
  desk("live");
  desk("mark");
  desk("record");
  EXPECT_EQ(desk("unmark").said, "the take with these marks has ended");
  EXPECT_EQ(desk("marking").said, "marking off");
  desk("refine");
  EXPECT_EQ(desk("marking").said, "only the live picture can be marked");
  desk("live");
  EXPECT_EQ(desk("marking").said, "aim the cross at box 1 corner 2");
  desk.controls.begin_marks();
  EXPECT_EQ(desk("unmark").said, "no corner is marked");
  EXPECT_TRUE(desk.controls.look().marking.is_on);
}

// A recording goes on in another take if a disk is full, without a press.
TEST(MarkingControls, BeginAgainInATakeThatDoesNotHaveTheMarks) {
  Desk desk;
  desk("marking");
  desk("record");
  desk.controls.use_take({.name = "12A_take001"});
  desk.controls.use_aim(aim(left, corner));
  desk("mark");
  desk.controls.use_take({.name = "12A_take002"});
  EXPECT_EQ(desk("unmark").said, "the take with these marks has ended");
  EXPECT_EQ(desk("mark").said,
            "marks so far are in 12A_take001; mark its boxes again; box 1 corner 1: marked once");
  EXPECT_EQ(desk("unmark").said, "box 1 corner 1: mark withdrawn, not marked");
}

// The press that ends a refinement was aimed at the picture before it.
TEST(MarkingControls, DoNotMarkWithThePressThatEndsARefinement) {
  Desk desk;
  desk("marking");
  desk("record");
  desk.controls.use_aim(aim(left, corner));
  EXPECT_TRUE(desk.controls.perform(*set::find_action("mark"), true).refused);
}

}  // namespace previz::rig::marking_test
