// The file of parts: what it holds, and what is said of its mistakes.
#include "daemon/tools/model/parts.hpp"

#include "tests/support/test.hpp"

namespace previz::test {
namespace {

const std::string picture_tables = R"(
[[picture]]
file = "0000.png"
[picture.points]
a = [100, 200.5]
b = [150, 210]
c = [160, 260]
once = [1, 2]
[[picture]]
file = "0001.png"
[picture.points]
a = [110, 200.5]
b = [160, 210]
c = [170, 260]
)";

// Returns what is said of the marks with these parts behind them.
std::string refusal_of(const std::string& parts) {
  return error_of([&] { model::parse_parts(picture_tables + parts, "model.toml"); });
}

TEST(ModelParts, AreReadWithTheirMarks) {
  const model::Parts parts = model::parse_parts(picture_tables + R"(
[marks]
accuracy_px = 0.5
[[plane]]
name = "table"
tags = [0, 2]
points = ["a"]
[[box]]
name = "crate"
on = "table"
top = ["a", "b", "c", ""]
height_m = 0.1
[[scan]]
name = "statue"
file = "scans/statue.ply"
unit = "in"
[scan.points]
a = [1, 2, 3]
b = [0.5, 0, 0]
c = [0, 1, 0]
)",
                                                "folder/model.toml");
  EXPECT_EQ(parts.mark_px, 0.5);
  ASSERT_EQ(parts.pictures.size(), 2u);
  EXPECT_EQ(parts.pictures[1].name, "0001.png");
  ASSERT_EQ(parts.pictures[0].marks.size(), 4u);
  EXPECT_EQ(parts.pictures[0].marks[0].point, "a");
  EXPECT_EQ(parts.pictures[0].marks[0].px, glm::dvec2(100, 200.5));
  ASSERT_EQ(parts.planes.size(), 1u);
  EXPECT_THAT(parts.planes[0].tags, ElementsAre(0, 2));
  ASSERT_EQ(parts.boxes.size(), 1u);
  EXPECT_THAT(parts.boxes[0].top, ElementsAre("a", "b", "c", ""));
  EXPECT_EQ(parts.boxes[0].height_m, 0.1);
  ASSERT_EQ(parts.scans.size(), 1u);
  EXPECT_EQ(parts.scans[0].file, "folder/scans/statue.ply");
  EXPECT_EQ(parts.scans[0].unit, model::LengthUnit::in);
  EXPECT_EQ(parts.scans[0].up, std::nullopt);
  EXPECT_EQ(parts.scans[0].error_m, 0.0005);
  ASSERT_EQ(parts.scans[0].points.size(), 3u);
  EXPECT_EQ(parts.scans[0].points[1].name, "b");
  EXPECT_EQ(parts.scans[0].points[1].at, glm::dvec3(0.5, 0, 0));
}

TEST(ModelParts, TheExampleHasEveryKind) {
  const std::filesystem::path file =
      std::filesystem::path(PREVIZ_SOURCE_DIR) / "config/parts.example.toml";
  std::ifstream stream(file);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const model::Parts parts = model::parse_parts(text, file);
  EXPECT_EQ(parts.pictures.size(), 2);
  EXPECT_EQ(parts.planes.size(), 7);
  EXPECT_EQ(parts.boxes.size(), 2);
  EXPECT_EQ(parts.cylinders.size(), 1);
  EXPECT_EQ(parts.rooms.size(), 1);
  ASSERT_EQ(parts.scans.size(), 2);
  EXPECT_EQ(parts.scans[0].points.size(), 4);
  // What is commented out is valid as well.
  const std::string whole = std::regex_replace(text, std::regex("\n#(\\w+ = )"), "\n$1");
  EXPECT_NO_THROW(model::parse_parts(whole, file));
}

TEST(ModelParts, AScanNeedsNoPoints) {
  const model::Parts parts =
      model::parse_parts("[[scan]]\nname = \"s\"\nfile = \"s.obj\"\n", "model.toml");
  ASSERT_EQ(parts.scans.size(), 1u);
  EXPECT_THAT(parts.scans[0].points, IsEmpty());
}

TEST(ModelParts, MistakesAreNamedWithTheirLine) {
  const struct {
    const char* parts;
    const char* words;
  } mistakes[] = {
      {"", "has no part"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\nname_ = 1\n",
       "model.toml:18:1: plane.name_: unknown key; did you mean name?"},
      {"[[plane]]\nname = \"t\"\ntags = [0.5]\n", "plane.tags"},
      {"[[plane]]\nname = \"t\"\npoints = [\"a\", \"b\"]\n",
       "it has no tag and 2 points, and needs 3"},
      {"[[plane]]\nname = \"t\"\npoints = [\"a\", \"b\", \"d\"]\n", "no picture has a point \"d\""},
      {"[[plane]]\nname = \"t\"\npoints = [\"a\", \"b\", \"once\"]\n",
       "point \"once\" is marked in one picture only"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\n[[plane]]\nname = \"t\"\ntags = [1]\n",
       "\"t\" is used twice"},
      {"[[plane]]\nname = \"wall\"\npoints = [\"a\", \"b\"]\nupright_on = "
       "\"flor\"\n[[plane]]\nname = \"floor\"\ntags = [0]\n",
       "there is no plane \"flor\"; did you mean floor?"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\nheight_m = 1\n",
       "plane.height_m: needs upright_on, the plane that it is the height over"},
      {"[[box]]\nname = \"b\"\ntop = [\"a\", \"b\", \"c\", \"\"]\n",
       "box \"b\" has one side only: nothing says how high it is"},
      {"[[box]]\nname = \"b\"\ntop = [\"a\", \"b\", \"\", \"\"]\nheight_m = 1\n",
       "2 of its four upright edges marked and needs 3"},
      {"[[box]]\nname = \"b\"\ntop = [\"a\", \"b\", \"c\"]\nheight_m = 1\n",
       "has 3 corners; allowed: 4"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\n[[cylinder]]\nname = \"c\"\non = \"t\"\nbottom = "
       "[\"a\", \"b\", \"c\"]\n",
       "no point of the upper rim is marked"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\n[[room]]\nname = \"r\"\nfloor = \"t\"\nwalls = "
       "[\"t\"]\nheight_m = 2\n",
       "has 1 planes; allowed: 4"},
      {"[[plane]]\nname = \"tag 3\"\ntags = [3]\n",
       "plane.name: \"tag 3\" is how printed tags are named"},
      {"[[scan]]\nname = \"s\"\n", "scan.file: is missing"},
      {"[[scan]]\nname = \"s\"\nfile = \"s.obj\"\nunit = \"ft\"\n",
       "is not allowed; allowed: \"m\" | \"cm\" | \"mm\" | \"in\""},
      {"[[scan]]\nname = \"s\"\nfile = \"s.obj\"\n[scan.points]\na = [0, 0, 0]\nb = [1, 0, 0]\n",
       "scan \"s\" has 2 points, and needs 3 that are marked in pictures; give the scan's own "
       "coordinates of them under [scan.points], or remove [scan.points] to place"},
      {"[[scan]]\nname = \"s\"\nfile = \"s.obj\"\n[scan.points]\na = [0, 0, 0]\nb = [1, 0, "
       "0]\nonce = "
       "[0, 1, 0]\n",
       "model.toml:21:1: scan.points.once: point \"once\" is marked in one picture only"},
      {"[[scan]]\nname = \"s\"\nfile = \"s.obj\"\n[scan.points]\na = [0, 0]\n", "scan.points.a"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\n[[cylinder]]\nname = \"can\"\non = \"t\"\ntop = "
       "[\"a\", "
       "\"b\", \"c\"]\n[[scan]]\nname = \"s\"\nfile = \"s.obj\"\n[scan.points]\na = [0, 0, 0]\nb = "
       "[1, "
       "0, 0]\nc = [0, 1, 0]\n",
       "scan.points.a: is on a rim of cylinder \"can\""},
      {"[[picture]]\nfile = \"0000.png\"\n[[plane]]\nname = \"t\"\ntags = [0]\n",
       "has a table already"},
      {"[[picture]]\nfile = \"2\"\n[picture.points]\na = [1]\n", "picture.points.a"},
      {"[[picture]]\nfile = \"2\"\n[picture.points]\n\"\" = [1, 1]\n", "has an empty name"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\npoints = [\"\"]\n", "plane.points: has an empty name"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\nedges = [[\"a\", \"\"]]\n",
       "plane.edges: has an empty name"},
      {"[[plane]]\nname = \"t\"\ntags = [0, 0]\n", "tag 0 is listed twice"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\noutline = [\"a\", \"b\", \"c\"]\nedges = [[\"a\", "
       "\"b\"]]\n",
       "plane.edges: conflicts with outline"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\npoints = [\"a\"]\n[[cylinder]]\nname = \"can\"\non = "
       "\"t\"\ntop = [\"a\", \"b\", \"c\"]\n",
       "point \"a\" is on a rim of cylinder \"can\""},
      {"[[box]]\nname = \"b\"\ntop = [\"a\", \"b\", \"\", \"\"]\ntags = [3]\n",
       "mark three, or none"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\n[[plane]]\nname = \"n\"\ntags = [1]\n[[plane]]\nname "
       "= \"e\"\ntags = [2]\n"
       "[[plane]]\nname = \"s\"\ntags = [3]\n[[room]]\nname = \"r\"\nfloor = \"t\"\nwalls = "
       "[\"t\", \"n\", \"e\", \"s\"]\nheight_m = 2\n",
       "room.walls: has a plane twice, or the floor"},
      {"[[plane]]\nname = \"t\"\ntags = [0]\nedges = [[\"a\", \"b\"]]\n[[plane]]\nname = "
       "\"n\"\ntags = [1]\n[[plane]]\nname = \"e\"\ntags = [2]\n"
       "[[plane]]\nname = \"s\"\ntags = [3]\n[[plane]]\nname = \"w\"\ntags = [4]\n"
       "[[room]]\nname = \"r\"\nfloor = \"t\"\nwalls = [\"n\", \"e\", \"s\", \"w\"]\n"
       "height_m = 2\n",
       "plane.edges: \"t\" is a side of room \"r\" and ends where the room's other sides are"},
  };
  for (const auto& mistake : mistakes)
    EXPECT_THAT(refusal_of(mistake.parts), HasSubstr(mistake.words)) << mistake.parts;
}

}  // namespace
}  // namespace previz::test
