// The model of what was marked on the rig: a take in whose events somebody has marked three corners
// of a cube.
#include "daemon/tools/model/rig_marks.hpp"

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/marks.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/model/model.hpp"
#include "daemon/tools/model/parts_text.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::model::rig_marks_test {

namespace fs = std::filesystem;

const fs::path demo_folder = fs::path(PREVIZ_SOURCE_DIR) / "config/demo";

// The demo's take, in whose events the marks of its file of parts are, which were made by eye.
class MarkedTake : public testing::Test {
 protected:
  void SetUp() override {
    fs::copy(demo_folder, folder_ / "demo", fs::copy_options::recursive);
    options_.footage = folder_ / "demo/session";
    options_.set_file = folder_ / "demo/demo.toml";
    options_.out = folder_ / "demo/marked.glb";
    options_.grey = true;  // colours take seconds
    session::Session opened = session::open_session(options_.footage);
    pictures_ = session::open_stream(opened, "observer")->records();
    by_hand_ =
        model::parse_parts(test::content_of(demo_folder / "real.toml"), demo_folder / "real.toml");
  }

  // Marks a point of the file of parts as a corner, in the first pictures of that file.
  void mark(const std::string& point, const session::BoxCorner& corner, std::size_t pictures = 3) {
    std::ofstream events(options_.footage / "events.jsonl", std::ios::app);
    for (const model::MarkedPicture& picture : by_hand_.pictures) {
      const auto found = std::ranges::find(picture.marks, point, &model::Mark::point);
      if (found == picture.marks.end() || pictures-- == 0) return;
      const std::size_t index = std::stoul(picture.name.substr(picture.name.find(' ')));
      events << session::to_line(session::MarkEvent{pictures_.at(index).timestamp_ns,
                                                    session::name_of(corner), found->px})
             << '\n';
    }
  }

  std::string made() {
    std::ostringstream out;
    model::make_model(options_, out);
    return out.str();
  }

  std::string refusal() {
    std::string why = test::error_of([&] { made(); });
    EXPECT_FALSE(fs::exists(folder_ / "demo/marked.glb"));
    return why;
  }

  test::TemporaryDirectory folder_;
  model::ModelOptions options_;
  std::vector<session::FrameRecord> pictures_;
  model::Parts by_hand_;
};

TEST_F(MarkedTake, BecomesAModelWithoutAFileOfParts) {
  for (std::size_t i = 0; i < 3; ++i) {
    mark("r" + std::to_string(i + 1), {0, i});
    mark("y" + std::to_string(i + 1), {1, i});
  }
  options_.write = true;
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("18 marks in 3 pictures"));
  // True: 90 and 80 mm, with faces that are accurate to half a millimetre.
  EXPECT_THAT(said,
              testing::ContainsRegex("box 1: (89\\.[4-9]|90\\.[0-6]) x (89\\.[4-9]|90\\.[0-6]) x"));
  EXPECT_THAT(said,
              testing::ContainsRegex("box 2: (79\\.[4-9]|80\\.[0-6]) x (79\\.[4-9]|80\\.[0-6]) x"));
  EXPECT_TRUE(fs::exists(folder_ / "demo/marked.glb"));
  const set::Set set = set::load_set(*options_.set_file);
  EXPECT_NE(std::ranges::find(set.objects, "marked", &set::Object::name), set.objects.end());
  EXPECT_THAT(said, Not(HasSubstr("warning: box")));
}

TEST_F(MarkedTake, SaysWhatABoxLacks) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  mark("y1", {1, 0});
  mark("y2", {1, 1}, 1);
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("warning: box 2 is not in the model: box 2 corner 2 is marked in 1 "
                              "picture and needs two, from different sides"));
  EXPECT_THAT(said, HasSubstr("box 1: 9"));
  EXPECT_THAT(said, HasSubstr("9 marks in 3 pictures"));
  EXPECT_THAT(said, Not(HasSubstr("belongs to no part")));
  EXPECT_THAT(said, HasSubstr("box 1 stands on plane 1 (tags 0, 1, 2)"));
}

TEST_F(MarkedTake, GivesAFileOfPartsToGoOnWith) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  options_.pictures = folder_ / "marks";
  made();
  const fs::path file = folder_ / "marks/model.toml";
  const model::Parts parts = model::parse_parts(test::content_of(file), file);
  ASSERT_EQ(parts.boxes.size(), 1u);
  EXPECT_EQ(parts.boxes[0].on, "plane 1");
  EXPECT_EQ(parts.boxes[0].top,
            (std::vector<std::string>{"box 1 corner 1", "box 1 corner 2", "box 1 corner 3", ""}));
  EXPECT_EQ(parts.mark_px, 2);
  EXPECT_GT(parts.pictures.size(), 3u);
  std::size_t marks = 0;
  for (const model::MarkedPicture& picture : parts.pictures) {
    marks += picture.marks.size();
    std::string name = picture.name + ".png";
    std::ranges::replace(name, ' ', '_');
    EXPECT_TRUE(fs::exists(folder_ / "marks" / name)) << name;
  }
  EXPECT_EQ(marks, 9u);
  // The same model comes of it.
  options_.pictures.reset();
  const std::string direct = made();
  options_.parts_file = file;
  EXPECT_EQ("box 1 stands on plane 1 (tags 0, 1, 2)\n" + made(), direct);
}

TEST_F(MarkedTake, WithoutMarksNeedsAFileOfParts) {
  EXPECT_THAT(refusal(),
              HasSubstr("nothing was marked on the rig while it was recorded; give --parts"));
  options_.footage = folder_ / "demo";
  EXPECT_THAT(refusal(), HasSubstr("demo: is not a session, and only those have marks"));
}

// Each is a mistake that a crew can make; nothing is written, and the words say what to do.
TEST_F(MarkedTake, IsNoModelWithoutABox) {
  mark("r1", {0, 0});
  EXPECT_THAT(refusal(), HasSubstr("none of the boxes that were marked can be made"));
  std::ofstream(options_.footage / "events.jsonl")
      << "{\"timestamp_ns\": 1, \"mark\": \"box 1 corner 1\", \"px\": [1, 2]}\n";
  EXPECT_THAT(refusal(), HasSubstr("session: none of its marks can be used; give --parts"));
}

TEST_F(MarkedTake, LeavesABoxWithCornersInAnotherOrderOut) {
  for (const auto& [point, corner] : {std::pair("r1", 0), {"r3", 1}, {"r2", 2}})
    mark(point, {0, std::size_t(corner)});
  for (std::size_t i = 0; i < 3; ++i) mark("y" + std::to_string(i + 1), {1, i});
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("warning: box 1 is not in the model: its corners were not marked in "
                              "order around its upper side"));
  EXPECT_THAT(said, HasSubstr("box 2: "));
}

// The pictures of a camera that hardly moves, as frame 0 and itself.
TEST_F(MarkedTake, LeavesABoxWithACornerFromOneSideOut) {
  for (std::size_t i = 0; i < 3; ++i) mark("y" + std::to_string(i + 1), {1, i});
  mark("r1", {0, 0});
  mark("r2", {0, 1});
  const auto at = [&](std::size_t picture, glm::dvec2 px) {
    std::ofstream(options_.footage / "events.jsonl", std::ios::app)
        << session::to_line(
               session::MarkEvent{pictures_.at(picture).timestamp_ns, "box 1 corner 3", px})
        << '\n';
  };
  // A spot that both pictures show in nearly one direction, by their poses: the horizon.
  at(0, {320, -200 + 200});
  at(1, {320, 0});
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("warning: box 1 is not in the model: box 1 corner 3 "));
  EXPECT_THAT(said, HasSubstr("box 2: "));
}

// Another corner of the cube in one picture: no model can be made of that box, and the other is.
TEST_F(MarkedTake, LeavesABoxWhoseMarksDisagreeOut) {
  for (std::size_t i = 0; i < 3; ++i) mark("y" + std::to_string(i + 1), {1, i});
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i}, 2);
  std::ofstream(options_.footage / "events.jsonl", std::ios::app)
      << session::to_line(
             session::MarkEvent{pictures_.at(5).timestamp_ns, "box 1 corner 1", {110, 290}})
      << '\n';
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("warning: box 1 is not in the model: "));
  EXPECT_THAT(said, HasSubstr("box 2: "));
}

TEST_F(MarkedTake, GivesTheTagsAloneWithoutAMark) {
  options_.tags_only = true;
  options_.write = true;
  made();
  EXPECT_TRUE(fs::exists(*options_.out));
}

TEST_F(MarkedTake, IsNamedAsTheTakeBesideTheSet) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  options_.out.reset();
  options_.footage /= "";
  made();
  EXPECT_TRUE(fs::exists(folder_ / "demo/session.glb"));
}

TEST_F(MarkedTake, DoesWithoutPicturesWhoseTagsDoNotShowTheCamera) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  set::Tracking tracking = set::load_set(*options_.set_file).tracking;
  tracking.tags.clear();
  const ObserverCalibration camera = *session::open_session(options_.footage).info.observer;
  const RigMarks marks = rig_marks(options_.footage, camera, tracking);
  EXPECT_TRUE(marks.pictures.empty());
  EXPECT_TRUE(marks.views.views.empty());
  EXPECT_THAT(
      marks.missing,
      ElementsAre("frame 0: shows no tags of the set that fit together; its marks are not used",
                  "frame 2: shows no tags of the set that fit together; its marks are not used",
                  "frame 5: shows no tags of the set that fit together; its marks are not used"));
}

// Boxes stand on the nearest plane of tags that is under them.
TEST_F(MarkedTake, StandsOnTheNearestPlaneOfTagsBelow) {
  set::Tracking tracking = set::load_set(*options_.set_file).tracking;
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  const ObserverCalibration camera = *session::open_session(options_.footage).info.observer;
  const RigMarks marks = rig_marks(options_.footage, camera, tracking);
  const auto on = [&] {
    const MarkedBoxes marked = boxes_of(marks, tracking.tags, options_.footage);
    return marked.boxes.empty() ? marked.remarks.at(0) : marked.boxes[0].on;
  };
  EXPECT_EQ(on(), "plane 1");
  // A tag at the left of the first one, where the cube is, under its upper side at 0.09 m.
  set::Tag tag = tracking.tags.front();
  const auto put = [&](double x, double z) {
    tracking.tags.resize(3);
    tag.id = 100;
    tag.world_from_tag[3] = {x, 0, z, 1};
    tracking.tags.push_back(tag);
  };
  put(-0.2, 0.05);
  EXPECT_EQ(on(), "plane 2");
  for (const double z : {0.083, 0.09, 0.097, 0.2}) {  // on its lid, as well as marks know that
    put(-0.2, z);
    EXPECT_EQ(on(), "plane 1") << z;
  }
  put(5, 0.05);  // a table far away
  EXPECT_EQ(on(), "plane 1");
  tag.world_from_tag = glm::dmat4({1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}, {0, 0, 0, 1});
  put(-0.2, 0.05);  // a wall
  EXPECT_EQ(on(), "plane 1");
  tracking.tags.erase(tracking.tags.begin(), tracking.tags.begin() + 3);
  EXPECT_THAT(on(), HasSubstr("no tag of the set lies flat on what it stands on"));
}

}  // namespace previz::model::rig_marks_test
