// A take that came without poses: they are found by the set's tags without rendering, and its
// camera and its objects are exported where they are.
#include <glm/gtc/matrix_transform.hpp>
#include <nlohmann/json.hpp>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/exchange/camera_track.hpp"
#include "daemon/tools/exchange/placed_model.hpp"
#include "daemon/tools/exchange/take_track.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/import_fixture.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::exchange::take_track_test {

namespace fs = std::filesystem;

constexpr int width = 320, height = 240, frames = 4, unseen = 2;

// The tag lies on the table; in frame `unseen` somebody has put a hand on it.
glm::dmat4 pose_of(int frame) {
  return test::camera_looking({0.05 * frame, -0.4, 0.5}, glm::dvec3(0));
}

const char* set_text = R"(
[set]
name = "desk"
[observer]
driver = "replay"
device = "session"
[[tag]]
id = 3
size_m = 0.12
position_m = [0.0, 0.0, 0.0]
[[object]]
name = "shelf"
file = "shelf.glb"
position_m = [-0.05, 0.0, -0.28]
rotation_deg = [10.0, 20.0, 90.0]
presence = "virtual"
)";

void write_model(const fs::path& file) {
  test::GltfWriter gltf;
  gltf.root("shelf", gltf.triangle_mesh(), {{"translation", {0.1, 0.2, 0.3}}});
  gltf.save(file);
}

class UntrackedTake : public testing::Test {
 protected:
  UntrackedTake() {
    write_model(directory_ / "shelf.glb");
    test::TagScene scene;
    scene.lens = test::plain_lens(width, height, 300);
    scene.tags = {test::flat_tag(3, 0.12, glm::dvec3(0))};
    session::SessionInfo info;
    info.name = "walk";
    info.set_text = set_text;
    info.observer.emplace();
    info.observer->intrinsics = scene.lens;
    session::SessionWriter writer(session_, info);
    writer.add_asset("shelf.glb", directory_ / "shelf.glb");
    std::mt19937 random(1);
    for (int i = 0; i < frames; ++i) {
      scene.world_from_camera = pose_of(i);
      test::TagScene shown = scene;
      if (i == unseen) shown.tags.clear();
      Frame frame =
          test::expose(test::render(shown), {.response = info.observer->response}, random);
      frame.source = "observer";
      frame.sequence = static_cast<std::uint64_t>(i);
      frame.timestamp_ns = frame.arrival_ns = 1'000'000'000 + i * 40'000'000;
      writer.write(frame);
    }
    writer.close();
  }

  void take_tags_out() {
    std::string toml = test::content_of(session_ / "session.toml");
    const std::size_t tag = toml.find("[[tag]]");
    ASSERT_NE(tag, std::string::npos);
    toml.erase(tag, toml.find("[[object]]") - tag);
    session::replace_file(session_ / "session.toml", toml);
  }

  // World places of the object's corners as the renderer has them.
  static glm::dmat4 place_in(const fs::path& folder, const std::string& place) {
    std::ofstream(folder / "set.toml")
        << "[set]\nname = \"one\"\n[observer]\ndriver = \"replay\"\ndevice = \"x\"\n"
           "[[object]]\nname = \"shelf\"\nfile = \"shelf.glb\"\npresence = \"virtual\"\n"
        << place;
    return scene::load_scene(set::load_set(folder / "set.toml")).instances.at(0).world_from_object;
  }

  test::TemporaryDirectory directory_;
  const fs::path session_ = directory_ / "session", out_ = directory_ / "out";
  std::ostringstream said_;
};

double distance(const glm::dmat4& a, const glm::dmat4& b) {
  double most = 0;
  for (int c = 0; c < 4; ++c)
    for (int r = 0; r < 4; ++r) most = std::max(most, std::abs(a[c][r] - b[c][r]));
  return most;
}

// A tag of about 60 px is found to a tenth of a pixel: 0.1 / 300 at 0.65 m, over 60 px of leverage.
TEST_F(UntrackedTake, PosesAreFoundWithoutRendering) {
  TrackOptions options;
  options.session = session_;
  options.out = directory_ / "poses.jsonl";
  EXPECT_EQ(track_take(options, said_), 0);
  EXPECT_THAT(said_.str(), HasSubstr("3 of 4 frames tracked, corners off by "));
  EXPECT_THAT(said_.str(), HasSubstr("tag 3: seen in 3 frames, used for the camera in 3\n"));
  EXPECT_THAT(said_.str(), HasSubstr("1 without a pose, e.g. frame 2: "));
  EXPECT_THAT(said_.str(), Not(HasSubstr("warning")));
  std::istringstream lines(test::content_of(*options.out));
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const auto json = nlohmann::json::parse(line);
    EXPECT_EQ(json["frame"], count);
    EXPECT_EQ(json["tracked"], count != unseen);
    if (count == unseen) {
      EXPECT_THAT(json["reason"].get<std::string>(), Not(HasSubstr("\n")));
      continue;
    }
    glm::dmat4 pose;
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) pose[c][r] = json["world_from_camera"][r][c];
    EXPECT_LT(distance(pose, pose_of(count)), 0.02);
    EXPECT_EQ(json["tags"], nlohmann::json({3}));
  }
  EXPECT_EQ(count, frames);
}

// Three frames show three tags, three more only those two that disagree.
TEST(MovedTag, IsNamedAndNotUsedWhereTwoOthersAgree) {
  for (const double moved_m : {0.01, 0.04}) {
    const test::TemporaryDirectory directory;
    test::TagScene scene;
    scene.lens = test::plain_lens(width, height, 300);
    scene.tags = {test::flat_tag(0, 0.12, glm::dvec3(0)),
                  test::flat_tag(1, 0.12, {0.2 + moved_m, 0, 0}),
                  test::flat_tag(2, 0.12, {-0.2, 0.02, 0})};
    session::SessionInfo info;
    info.set_text = "[set]\nname = 'three'\n[observer]\ndriver = 'replay'\ndevice = 'x'\n";
    for (int id = 0; id < 3; ++id)
      info.set_text +=
          "[[tag]]\nid = " + std::to_string(id) + "\nsize_m = 0.12\nposition_m = [" +
          std::vector<std::string>{"0.0, 0.0", "0.2, 0.0", "-0.2, 0.02"}[std::size_t(id)] +
          ", 0.0]\n";
    info.observer.emplace();
    info.observer->intrinsics = scene.lens;
    {
      session::SessionWriter writer(directory / "session", info);
      std::mt19937 random(1);
      for (int i = 0; i < 6; ++i) {
        scene.world_from_camera = test::camera_looking({0.1, -0.5, 0.6 - 0.01 * i}, {0, 0, 0});
        if (i == 3) scene.tags.pop_back();
        Frame frame =
            test::expose(test::render(scene), {.response = info.observer->response}, random);
        frame.source = "observer";
        frame.sequence = static_cast<std::uint64_t>(i);
        frame.timestamp_ns = frame.arrival_ns = 1'000'000'000 + i * 40'000'000;
        writer.write(frame);
      }
      writer.close();
    }
    TrackOptions options;
    options.session = directory / "session";
    std::ostringstream said;
    EXPECT_EQ(track_take(options, said), 0);
    EXPECT_THAT(said.str(), HasSubstr("6 of 6 frames tracked"));
    EXPECT_THAT(said.str(), HasSubstr("tag 1: seen in 6 frames, used for the camera in 0"));
    EXPECT_THAT(said.str(), HasSubstr("warning: tag 1 is "));
    EXPECT_THAT(said.str(), HasSubstr("`previz calibrate tags TAKE`"));
    EXPECT_THAT(said.str(), Not(HasSubstr("all tags measure")));
  }
}

// The tracker's tests show what is judged (PoseJudgement.*).
TEST_F(UntrackedTake, SaysWhatDoesNotHold) {
  TrackOptions options;
  options.session = session_;
  options.set_file = directory_ / "other.toml";
  const std::string text = session::open_session(session_).info.set_text;
  session::replace_file(*options.set_file, "[tracking]\nfamily = \"tag25h9\"\n" + text);
  EXPECT_EQ(track_take(options, said_), 1);
  EXPECT_THAT(said_.str(), HasSubstr("warning: no tag of tag25h9 in any picture: the pictures hold "
                                     "tags of tag36h11: tag 3; write tracking.family"));
  EXPECT_THAT(said_.str(), Not(HasSubstr("tag 3: seen")));
}

// Importing looks at a frame of every hundred, from the 51st on.
TEST_F(UntrackedTake, IsJudgedWhereItIsImported) {
  session::Session session = session::open_session(session_);
  const FramePtr frame = session::open_stream(session, "observer")->read(0);
  const cv::Mat picture(height, width, frame->format == PixelFormat::gray8 ? CV_8UC1 : CV_8UC3,
                        const_cast<std::uint8_t*>(frame->bytes.data()));
  write_picture(directory_ / "a.png", picture);
  session::replace_file(directory_ / "set.toml",
                        std::string("[tracking]\nfamily = \"tag25h9\"\n") + set_text);
  Json json = {{"set", "set.toml"},
               {"observer",
                {{"pictures", std::vector<std::string>(60, "a.png")},
                 {"fps", 25},
                 {"exposure", 1},
                 {"intrinsics",
                  {{"width", width},
                   {"height", height},
                   {"fx", 300},
                   {"fy", 300},
                   {"cx", 159.5},
                   {"cy", 119.5}}}}}};
  session::replace_file(directory_ / "FRAMES.json", json.dump());
  EXPECT_THAT(import_session({directory_ / "FRAMES.json", directory_ / "take"}).notes,
              Contains(HasSubstr("no tag of tag25h9 in any picture: the pictures hold")));
}

// It was refused: "track.jsonl has no pose".
TEST_F(UntrackedTake, IsExportedWithItsCamera) {
  export_take({session_, out_}, said_);
  EXPECT_THAT(said_.str(), HasSubstr("finding the poses of 4 frames"));
  EXPECT_THAT(said_.str(), HasSubstr("3 poses of 4 frames"));
  EXPECT_THAT(said_.str(), HasSubstr("rotation order ZXY"));
  EXPECT_EQ(std::ranges::count(test::content_of(out_ / "camera.chan"), '\n'), 3);
}

// It lay at the origin.
TEST_F(UntrackedTake, IsExportedWithItsObjectsInTheirPlaces) {
  export_take({session_, out_}, said_);
  const glm::dmat4 in_set = place_in(
      directory_.path(), "position_m = [-0.05, 0.0, -0.28]\nrotation_deg = [10.0, 20.0, 90.0]\n");
  EXPECT_LT(distance(place_in(out_, ""), in_set), 1e-12);
  EXPECT_GT(distance(in_set, glm::dmat4(1)), 0.2);
}

// The take was recorded before the tags were measured.
TEST_F(UntrackedTake, IsExportedWithAnotherSetFile) {
  session::replace_file(directory_ / "measured.toml",
                        session::open_session(session_).info.set_text);
  take_tags_out();
  ExportOptions options{session_, out_};
  options.set_file = directory_ / "measured.toml";
  export_take(options, said_);
  EXPECT_THAT(said_.str(), HasSubstr("3 poses of 4 frames"));
}

TEST_F(UntrackedTake, WithoutTagsSaysWhatToDo) {
  take_tags_out();
  EXPECT_THAT(test::error_of([&] {
                export_take({session_, out_}, said_);
              }),
              HasSubstr("`previz track` says why; the set file needs [[tag]]"));
}

TEST(PlacedModel, KeepsWhatItDoesNotKnow) {
  const test::TemporaryDirectory directory;
  for (const char* name : {"model.glb", "model.gltf"}) {
    write_model(directory / name);
    const std::string content = test::content_of(directory / name);
    const std::string placed =
        placed_model(content, "shelf", glm::translate(glm::dmat4(1), glm::dvec3(1, 2, 3)));
    EXPECT_THAT(placed, HasSubstr(R"("matrix":[1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,)"));
    EXPECT_THAT(placed, HasSubstr("1.0,3.0,-2.0,1.0]"));  // Z up became Y up
    if (content.starts_with("glTF")) {
      std::uint32_t length = 0, json = 0;
      std::memcpy(&length, placed.data() + 8, 4);
      std::memcpy(&json, placed.data() + 12, 4);
      EXPECT_EQ(length, placed.size());
      EXPECT_EQ(json % 4, 0u);
      std::uint32_t before = 0;
      std::memcpy(&before, content.data() + 12, 4);
      EXPECT_EQ(placed.substr(20 + json), content.substr(20 + before));
    }
  }
}

TEST(PlacedModel, WhatIsNoGltfIsRefused) {
  const glm::dmat4 place(1);
  for (const std::string& content :
       {std::string(), std::string("{}"), std::string("[1]"), std::string("no json"),
        std::string("glTF"), std::string("glTF") + std::string(8, '\1') + "\xff\xff\xff\xffJSON",
        std::string(R"({"scenes": [{"nodes": [0]}], "scene": "x"})"),
        std::string(R"({"scenes": 4})"), std::string(R"({"scene": 7, "scenes": [{}]})")})
    EXPECT_THROW(placed_model(content, "x", place), Error) << content;
}

}  // namespace previz::exchange::take_track_test
