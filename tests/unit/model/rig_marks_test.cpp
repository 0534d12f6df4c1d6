// The model of what was marked on the rig: a take in whose events somebody has marked three corners
// of a cube.
#include "daemon/model/rig_marks.hpp"

#include "daemon/model/model.hpp"
#include "daemon/model/parts_text.hpp"
#include "daemon/set/load.hpp"
#include "drivers/session/files.hpp"
#include "drivers/session/json_lines.hpp"
#include "drivers/session/marks.hpp"
#include "drivers/session/session.hpp"
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
    by_hand_ = model::parse_parts(session::read_file(demo_folder / "real.toml"),
                                  demo_folder / "real.toml");
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
  EXPECT_THAT(said, testing::ContainsRegex(
                        "box box 1: (89\\.[4-9]|90\\.[0-6]) x (89\\.[4-9]|90\\.[0-6]) x"));
  EXPECT_THAT(said, testing::ContainsRegex(
                        "box box 2: (79\\.[4-9]|80\\.[0-6]) x (79\\.[4-9]|80\\.[0-6]) x"));
  EXPECT_TRUE(fs::exists(folder_ / "demo/marked.glb"));
  const set::Set set = set::load_set(*options_.set_file);
  EXPECT_NE(std::ranges::find(set.objects, "marked", &set::Object::name), set.objects.end());
  EXPECT_THAT(said, testing::Not(HasSubstr("warning: box")));
}

TEST_F(MarkedTake, SaysWhatABoxLacks) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  mark("y1", {1, 0});
  mark("y2", {1, 1}, 1);
  const std::string said = made();
  EXPECT_THAT(said, HasSubstr("warning: box 2 is not in the model: box 2 corner 2 is marked in 1 "
                              "picture and needs two, from different sides"));
  EXPECT_THAT(said, HasSubstr("box box 1: "));
}

TEST_F(MarkedTake, GivesAFileOfPartsToGoOnWith) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  options_.pictures = folder_ / "marks";
  made();
  const fs::path file = folder_ / "marks/model.toml";
  const model::Parts parts = model::parse_parts(session::read_file(file), file);
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
  EXPECT_EQ(made(), direct);
}

TEST_F(MarkedTake, WithoutMarksNeedsAFileOfParts) {
  const std::string said = test::error_of([&] { made(); });
  EXPECT_THAT(said, HasSubstr("nothing was marked on the rig while it was recorded; give --parts"));
  EXPECT_FALSE(fs::exists(folder_ / "demo/marked.glb"));
}

TEST_F(MarkedTake, DoesWithoutPicturesWhoseTagsDoNotShowTheCamera) {
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  set::Tracking tracking = set::load_set(*options_.set_file).tracking;
  tracking.tags.clear();
  const ObserverCalibration camera = *session::open_session(options_.footage).info.observer;
  const RigMarks marks = rig_marks(options_.footage, camera, tracking);
  EXPECT_TRUE(marks.pictures.empty());
  EXPECT_TRUE(marks.boxes.empty());
  EXPECT_THAT(marks.missing,
              testing::ElementsAre(
                  "frame 0: shows no tags of the set that fit together; its marks are not used",
                  "frame 2: shows no tags of the set that fit together; its marks are not used",
                  "frame 5: shows no tags of the set that fit together; its marks are not used"));
}

// Boxes without a plane of tags below them, and those on the lid of another box.
TEST_F(MarkedTake, StandsOnTheNearestPlaneOfTagsBelow) {
  set::Tracking tracking = set::load_set(*options_.set_file).tracking;
  for (std::size_t i = 0; i < 3; ++i) mark("r" + std::to_string(i + 1), {0, i});
  const ObserverCalibration camera = *session::open_session(options_.footage).info.observer;
  const auto on = [&] {
    std::ostringstream out;
    const auto boxes = boxes_of(rig_marks(options_.footage, camera, tracking), tracking.tags, out);
    return boxes.empty() ? out.str() : boxes[0].on;
  };
  EXPECT_EQ(on(), "plane 1");
  set::Tag lid = tracking.tags.front();
  lid.id = 100;
  lid.world_from_tag[3].z += 0.05;  // under the cube's upper side, at 0.09 m
  tracking.tags.push_back(lid);
  EXPECT_EQ(on(), "plane 2");
  tracking.tags.back().world_from_tag[3].z += 0.05;
  EXPECT_EQ(on(), "plane 1");
  // A wall is no ground.
  tracking.tags.back().world_from_tag =
      glm::dmat4({1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}, {0, 5, 0, 1});
  EXPECT_EQ(on(), "plane 1");
}

}  // namespace previz::model::rig_marks_test
