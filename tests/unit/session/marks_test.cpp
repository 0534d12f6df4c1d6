// Marks of a take: what is written, and which of them count.
#include "daemon/core/session/marks.hpp"

#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/session.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::session {
namespace {

class SessionMarks : public testing::Test {
 protected:
  static std::vector<FrameRecord> pictures() {
    std::vector<FrameRecord> records(3);
    for (std::size_t i = 0; i < records.size(); ++i)
      records[i].timestamp_ns = 100 * (std::int64_t(i) + 1);
    return records;
  }
  void write(const std::vector<MarkEvent>& events) {
    SessionWriter writer(folder_ / "take", {});
    writer.write_event(50, "recording");
    for (const MarkEvent& event : events) writer.write(event);
    writer.write(ButtonEvent{"red", true, 60});
    writer.close();
  }
  Marks read() { return read_marks(folder_ / "take", pictures()); }

  test::TemporaryDirectory folder_;
};

TEST_F(SessionMarks, ComeBackBitForBit) {
  const MarkEvent mark{300, "box 1 corner 2", {0.1 + 0.2, 239.5}};
  const MarkEvent withdrawn{200, "ecke \"ä\"", {}, true};
  write({mark, withdrawn});
  const Lines<MarkEvent> lines = read_mark_lines(folder_ / "take/events.jsonl");
  EXPECT_EQ(lines.records, (std::vector{mark, withdrawn}));
  EXPECT_TRUE(lines.bad_lines.empty());
  EXPECT_EQ(read_button_lines(folder_ / "take/events.jsonl").records.size(), 1u);
}

TEST_F(SessionMarks, CountByPictureAndNotOnceTheyAreWithdrawn) {
  write({{300, "a", {1, 1}},
         {100, "a", {2, 2}},
         {100, "b", {3, 3}},
         {300, "a", {4, 4}},
         {100, "b", {}, true},
         {100, "c", {5, 5}}});
  const Marks marks = read();
  ASSERT_EQ(marks.marks.size(), 3u);
  EXPECT_EQ(marks.marks[0].picture, 0u);
  EXPECT_EQ(marks.marks[0].point, "a");
  EXPECT_EQ(marks.marks[0].px, glm::dvec2(2, 2));
  EXPECT_EQ(marks.marks[1].point, "c");
  EXPECT_EQ(marks.marks[2].picture, 2u);
  EXPECT_EQ(marks.marks[2].px, glm::dvec2(4, 4));
  EXPECT_TRUE(marks.missing.empty());
}

TEST_F(SessionMarks, OfAPictureThatTheTakeLacksAreNamed) {
  write({{150, "a", {1, 1}}, {200, "b", {2, 2}}});
  std::ofstream(folder_ / "take/events.jsonl", std::ios::app)
      << "{\"timestamp_ns\": 1, \"mark\": 5}\n{\"torn";
  const Marks marks = read();
  ASSERT_EQ(marks.marks.size(), 1u);
  EXPECT_EQ(marks.marks[0].point, "b");
  EXPECT_THAT(marks.missing,
              ElementsAre("events.jsonl: lines 5 to 6 cannot be understood, and may have marks",
                          "the picture in which \"a\" was marked is not in the session; "
                          "that mark is not used"));
}

TEST(BoxCorner, HasAName) {
  EXPECT_EQ(name_of({0, 2}), "box 1 corner 3");
  const auto corner = box_corner_of("box 12 corner 1");
  ASSERT_TRUE(corner);
  EXPECT_EQ(corner->box, 11u);
  EXPECT_EQ(corner->corner, 0u);
  for (const char* other :
       {"", "box", "box 1", "box 1 corner", "box 1 corner 4", "box 0 corner 1", "box 1 corner 0",
        "box 01 corner 1", "box 1 corner 1 ", "crate 1 corner 1", "box -1 corner 1",
        "box 18446744073709551616 corner 1"})
    EXPECT_FALSE(box_corner_of(other)) << other;
}

}  // namespace
}  // namespace previz::session
