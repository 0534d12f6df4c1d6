#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_description_test {

using namespace std::string_literals;

// The smallest glTF file: a .glb with one JSON chunk.
std::string glb(std::string json) {
  while (json.size() % 4) json += ' ';
  const auto word = [](std::size_t value) {
    std::string text;
    for (int i = 0; i < 4; ++i) text += static_cast<char>(value >> 8 * i & 255);
    return text;
  };
  return "glTF" + word(2) + word(20 + json.size()) + word(json.size()) + "JSON" + json;
}

const char* const desk_set = R"([set]
name = "desk"

[[object]]
name = "table"
file = "models/table.glb"
presence = "phantom"

[[object]]
name = "the table again"
file = "models/table.glb"
presence = "virtual"
)";

void write_set(const Shoot& shoot, const std::string& text = desk_set) {
  session::write_content(shoot.folder() / "desk.toml", text);
  session::write_content(shoot.folder() / "models" / "table.glb",
                         glb(R"({"asset":{"version":"2.0"}})"));
}

TEST(ImportDescription, TheSetComesAlongVerbatimWithItsFiles) {
  Shoot shoot;
  write_set(shoot);
  shoot.json["set"] = "desk.toml";
  EXPECT_EQ(shoot.import().assets, 1u);
  const session::Session opened = session::open_session(shoot.session());
  EXPECT_TRUE(opened.missing.empty());
  EXPECT_EQ(opened.info.name, "take");
  EXPECT_EQ(opened.info.set_name, "desk.toml");
  EXPECT_EQ(opened.info.set_text, desk_set);
  ASSERT_EQ(opened.info.assets.size(), 1u);
  EXPECT_EQ(session::content_of(shoot.session() / opened.info.assets.at("models/table.glb")),
            session::content_of(shoot.folder() / "models" / "table.glb"));
}

TEST(ImportDescription, ASetThatIsWrongIsTheSetsError) {
  Shoot shoot;
  write_set(shoot, "[set]\nnmae = \"x\"\n");
  shoot.json["set"] = "desk.toml";
  EXPECT_THAT(shoot.error(), HasSubstr("desk.toml:2"));
  shoot.json["set"] = "absent.toml";
  EXPECT_THAT(shoot.error(), HasSubstr("absent.toml"));
}

TEST(ImportDescription, AGltfThatNeedsOtherFilesIsAnError) {
  Shoot shoot;
  write_set(shoot);
  shoot.json["set"] = "desk.toml";
  session::write_content(
      shoot.folder() / "models" / "table.glb",
      glb(R"({"images":[{"uri":"data:image/png;base64,"},{"uri":"wood.png"}]})"));
  EXPECT_THAT(shoot.error(), HasSubstr("table.glb: needs wood.png beside it"));
  session::write_content(shoot.folder() / "models" / "table.glb",
                         "glTF\2\0\0\0\1\0\0\0\xff\xff\xff\xffJSON"s);
  EXPECT_THAT(shoot.error(), HasSubstr("table.glb: its glTF header is damaged"));
}

TEST(ImportDescription, PosesBecomeTheTrack) {
  Shoot shoot;
  const Json turned = {{0, -1, 0, 1.5}, {1, 0, 0, 2.5}, {0, 0, 1, 3.5}, {0, 0, 0, 1}};
  shoot.json["track"] = {{{"frame", 1}, {"world_from_camera", turned}, {"tags", {4, 7}}}};
  EXPECT_EQ(shoot.import().poses, 1u);
  const auto track = session::open_session(shoot.session()).track;
  ASSERT_EQ(track.size(), 3u);
  EXPECT_FALSE(track[0].tracked);
  EXPECT_TRUE(track[1].tracked);
  EXPECT_FALSE(track[2].tracked);
  EXPECT_EQ(track[1].timestamp_ns, 40'000'000);
  EXPECT_EQ(track[1].tags, (std::vector<int>{4, 7}));
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      EXPECT_NEAR(track[1].world_from_camera[column][row], turned[row][column].get<double>(),
                  1e-15);
}

// config/frames.example.json as it is shipped, with footage made to fit it.
TEST(ImportDescription, TheExampleIsValidAndMeansWhatItSays) {
  const test::TemporaryDirectory folder;
  const std::filesystem::path config = std::filesystem::path(PREVIZ_SOURCE_DIR) / "config";
  std::filesystem::copy(config / "frames.example.json", folder / "FRAMES.json");
  session::write_content(folder / "desk.toml", "[set]\nname = \"desk\"\n");
  for (const char* name : {"0000.png", "0001.png"})
    write_picture(folder / "observer" / name, noise_picture(1, CV_8UC3, 64, 48));
  session::write_content(folder / "light" / "light.csv",
                         "file,timestamp_ns,exposure\nb.png,200,0.5\na.png,100,0.25\n");
  for (const char* name : {"a.png", "b.png"})
    write_picture(folder / "light" / name, noise_picture(2, CV_8UC3, 64, 64));

  const ImportReport report = import_session({folder / "FRAMES.json", folder / "takes" / "3"});
  EXPECT_EQ(report.observer_frames, 2u);
  EXPECT_EQ(report.light_frames, 2u);
  EXPECT_GT(report.bytes, 0u);
  session::Session opened = session::open_session(folder / "takes" / "3");
  EXPECT_EQ(opened.info.name, "desk take 3");
  EXPECT_EQ(opened.info.clock, "utc");
  const ObserverCalibration& observer = opened.info.observer.value();
  EXPECT_EQ(observer.intrinsics.k1, -0.118);
  EXPECT_EQ(observer.intrinsics.p2, -0.0007);
  EXPECT_DOUBLE_EQ(observer.lens.value().focal_length_m, 0.0235);
  EXPECT_EQ(observer.responsivity, 28.3);
  const LightCameraCalibration& light = opened.info.light.value();
  EXPECT_EQ(light.intrinsics.k, (std::array{-0.02, 0.002, -0.0003, 0.0}));
  EXPECT_DOUBLE_EQ(light.intrinsics.max_angle_rad, 100 * std::numbers::pi / 180);
  EXPECT_EQ(light.response.kind, ResponseCurve::Kind::gamma);
  // Turned by 90 degrees about Z: the picture's right is world Y.
  EXPECT_NEAR(light.world_from_camera[0][1], 1, 1e-15);
  EXPECT_EQ(light.world_from_camera[3], glm::dvec4(-0.45, -0.05, 0.05, 1));
  const auto stream = session::open_stream(opened, "observer");
  EXPECT_EQ(stream->records()[1].timestamp_ns, 1'700'000'000'040'000'000);
  EXPECT_DOUBLE_EQ(stream->records()[1].exposure, 0.02 * 1.5 * 28.3);
  EXPECT_EQ(session::open_stream(opened, "light")->records()[0].exposure, 0.25);
  EXPECT_TRUE(opened.missing.empty());
}

struct Mistake {
  const char* pointer;  // RFC 6901 into the JSON of good()
  const char* value;    // what is written there; "" removes it
  const char* message;
};

Json good_calibrated(const Shoot& shoot) {
  Json json = shoot.json;
  json.merge_patch(Json::parse(R"({
    "observer": {
      "intrinsics": {"width": 32, "height": 24, "fx": 30, "fy": 30, "cx": 16, "cy": 12},
      "lens": {"focal_length_mm": 20, "f_number": 2, "focus_distance_m": 1}},
    "light": {
      "pictures": ["light.png"], "timestamps_ns": [5], "exposure": 1,
      "intrinsics": {"width": 16, "height": 16, "fx": 5, "fy": 5, "cx": 8, "cy": 8,
                     "max_angle_deg": 100},
      "pose": {"position_m": [0, 0, 1]}}})"));
  return json;
}

class Mistakes : public testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, AreToldWithTheirPathBeforeAnythingIsWritten) {
  const auto [pointer, value, message] = GetParam();
  Shoot shoot;
  write_picture(shoot.folder() / "light.png", noise_picture(1, CV_8UC3, 16, 16));
  shoot.json = good_calibrated(shoot);
  const Json::json_pointer at(pointer);
  if (*value)
    shoot.json[at] = Json::parse(value);
  else
    shoot.json[at.parent_pointer()].erase(at.back());
  EXPECT_THAT(shoot.error(), HasSubstr(message));
}

// What is wrong with the numbers of a calibration is shown by import_calibration_test.cpp.
const Mistake mistakes[] = {
    {"/observer", "", "FRAMES.json: observer is missing"},
    {"/observer", "[]", "FRAMES.json: observer must be an object"},
    {"/obsrever", "{}", "obsrever is unknown; did you mean observer?"},
    {"/observer/exposre", "1", "observer.exposre is unknown; did you mean exposure?"},
    {"/observer/zzzzzzzz", "1", "observer.zzzzzzzz is unknown; allowed: "},
    {"/observer/pictures", "", "observer.pictures is missing; allowed: "},
    {"/observer/pictures", R"("observer/%d.jpg")", "%d.jpg: file not found"},
    {"/observer/pictures", R"(["absent.png"])", "absent.png: is not a file"},
    {"/observer/pictures", "[]", "observer.pictures is empty"},
    {"/observer/pictures", "7", "observer.pictures must be a list"},
    {"/observer/video", R"("a.mkv")", "observer.video conflicts with pictures"},
    {"/observer/fps", "", "observer.fps is missing: the pictures have no times"},
    {"/observer/pictures", R"("clip.MP4")", R"(observer.pictures is a video; use "video")"},
    {"/observer/timestamps_ns", "[1]", "observer.timestamps_ns conflicts with another member"},
    {"/observer/fps", "0", "observer.fps: 0 is not allowed; allowed: finite number, above 0"},
    {"/observer/fps", R"("25")", R"(observer.fps: "25" is not allowed; allowed: number, above 0)"},
    {"/observer/start_ns", "-1", "observer.start_ns: -1 is not allowed; allowed: whole number, 0"},
    {"/observer/start_ns", "1.5",
     "observer.start_ns: 1.5 is not allowed; allowed: whole number, 0"},
    {"/observer/sort_by_time", "1",
     "observer.sort_by_time: 1 is not allowed; allowed: true or false"},
    {"/observer/csv", R"("absent.csv")", "absent.csv: cannot be opened"},
    {"/observer/exposure", "", "observer.exposure is missing; allowed: exposure, or"},
    {"/observer/exposure", "0",
     "observer.exposure: 0 is not allowed; allowed: finite number, above 0"},
    {"/observer/exposure", "[1, 2]", "observer.exposure has 2 entries; there are 3"},
    {"/observer/exposure", R"([1, "x", 2])",
     R"(observer.exposure[1]: "x" is not allowed; allowed: number)"},
    {"/observer/intrinsics/fx", "", "observer.intrinsics.fx: is missing"},
    {"/observer/intrinsics/width", "33", "observer.intrinsics is for 33x24"},
    {"/observer/intrinsics/k7", "0", "observer.intrinsics.k7 is unknown"},
    {"/observer/intrinsics", "", "observer.lens needs intrinsics too"},
    {"/observer/lens/focal_length", "3", "did you mean focal_length_mm?"},
    {"/light/timestamps_ns", "[1, 2]", "light.timestamps_ns has 2 entries; there are 1"},
    {"/light/timestamps_ns", R"("container")", "light.timestamps_ns must be a list, or"},
    {"/light/lens", "{}", "light.lens is unknown"},
    {"/light/response/dark_level", "[0, 0.6, 0]", "light.response.dark_level"},
    {"/light/pose", "", "light.pose is missing"},
    {"/light/pose/world_from_camera", "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
     "light.pose.position_m: conflicts with world_from_camera"},
    {"/track", R"([{"frame": 0}])", "track[0].world_from_camera is missing"},
    {"/track", R"([{"frame": 3, "world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}])",
     "track has a pose for frame 3; observer has frames 0 to 2"},
};
INSTANTIATE_TEST_SUITE_P(All, Mistakes, testing::ValuesIn(mistakes));

TEST(ImportDescription, PicturesOfDifferentSizesAreAnError) {
  Shoot shoot;
  write_picture(shoot.folder() / "observer" / "0002.png", noise_picture(1, CV_8UC3, 32, 25));
  EXPECT_THAT(shoot.error(),
              HasSubstr("0002.png: is rgb8 32x25; all pictures of observer must be rgb8 "
                        "32x24 like the first"));
}

// How many frames a video has is not known while FRAMES.json is read.
TEST(ImportDescription, ListsOfAVideoMustBeForAsManyFrames) {
  Shoot shoot;
  write_video(shoot.folder() / "take.mkv", {.pixel_format = "gray", .fps = 50},
              std::vector(4, Bytes(32 * 16, 7)));
  shoot.json["observer"] = {
      {"video", "take.mkv"}, {"exposure_s", {0.01, 0.01, 0.02, 0.02}}, {"gain", {1, 2}}};
  EXPECT_THAT(shoot.error(), HasSubstr("observer.gain has 2 entries; there are 4 frames"));
  shoot.json["observer"] = {
      {"video", "take.mkv"}, {"exposure", {1, 1, 2, 2}}, {"exposure_s", {0.01, 0.01, 0.02}}};
  EXPECT_THAT(shoot.error(), HasSubstr("observer.exposure_s has 3 entries; there are 4 frames"));
  shoot.json["observer"]["exposure_s"].push_back(0.02);
  shoot.json["observer"]["gain"] = {1, 1, 2, 2};
  EXPECT_EQ(shoot.error(), "");
}

// The smallest double is 4.9e-324, and the largest 1.8e308.
TEST(ImportDescription, ExposuresThatNoNumberHoldsAreRefused) {
  for (const double factor : {1e-200, 1e200}) {
    Shoot shoot;
    shoot.json["observer"].erase("exposure");
    shoot.json["observer"]["exposure_s"] = factor;
    shoot.json["observer"]["gain"] = {1, factor, 1};
    EXPECT_THAT(shoot.error(), HasSubstr("observer.exposure_s: frame 1: "));
  }
}

TEST(ImportDescription, TablesNameFileAndLine) {
  Shoot shoot;
  shoot.json["observer"].erase("fps");
  shoot.json["observer"]["csv"] = "t.csv";
  const auto error_with = [&](const std::string& table) {
    session::write_content(shoot.folder() / "t.csv", table);
    return shoot.error();
  };
  EXPECT_THAT(error_with(""), HasSubstr("t.csv: has no rows"));
  EXPECT_THAT(error_with("timestamp_ns,kind\n1\n"), HasSubstr("t.csv:2: has 1 cells"));
  EXPECT_THAT(error_with("timestamp_ns\n\"1\"\n"), HasSubstr("t.csv:2: quotes"));
  EXPECT_THAT(error_with("timestamp_ns\n1\n2\n3.5\n"),
              HasSubstr("column timestamp_ns, row 3: \"3.5\""));
  EXPECT_THAT(error_with("timestamp_ns,exposure\n1,1\n2,2\n3,3\n"),
              HasSubstr("observer.exposure is also a column of"));
  EXPECT_THAT(error_with("timestamp_ns\n1\n2\n"), HasSubstr("has 2 entries; there are 3 pictures"));
  EXPECT_EQ(error_with("\xef\xbb\xbftimestamp_ns,note\r\n1,\r\n2,b\r\n\r\n3,c"), "");
}

TEST(ImportDescription, NothingIsOverwritten) {
  Shoot shoot;
  EXPECT_EQ(shoot.error(), "");
  const ImportOptions again{shoot.folder() / "FRAMES.json", shoot.session()};
  EXPECT_THROW(import_session(again), Error);
  std::filesystem::remove_all(shoot.session());
  std::filesystem::create_directory(shoot.session());
  EXPECT_NO_THROW(import_session(again));  // an empty folder is taken
}

// The system refuses such a name without looking; the words are those of any file that is missing.
TEST(ImportDescription, ANameThatIsTooLongIsAMissingFile) {
  const test::TemporaryDirectory folder;
  const Json observer = {{"video", std::string(300, 'b')}, {"exposure", 1}};
  session::write_content(folder / "F.json", Json{{"name", "a"}, {"observer", observer}}.dump());
  const std::string error = test::error_of([&] {
    import_session({folder / "F.json", folder / "take"});
  });
  EXPECT_THAT(error, HasSubstr("observer.video"));
}

TEST(ImportDescription, WhatIsNotJsonIsAnError) {
  const test::TemporaryDirectory folder;
  const auto error_of = [&](const std::string& text) {
    session::write_content(folder / "F.json", text);
    return test::error_of([&] { import_session({folder / "F.json", folder / "take"}); });
  };
  EXPECT_THAT(error_of("{\n\"name\": }"), HasSubstr("F.json: is not JSON: "));
  EXPECT_THAT(error_of("{\n\"name\": }"), HasSubstr("line 2"));
  EXPECT_THAT(error_of("[]"), HasSubstr("F.json: the document must be an object"));
  EXPECT_THAT(error_of(""), HasSubstr("F.json: is not JSON"));
  EXPECT_THAT(error_of("{\n\"name\": }"), Not(HasSubstr("A video or a picture")));
  EXPECT_THAT(
      error_of("\0\0\0\x20"
               "ftypisom"s),
      HasSubstr("A video or a picture is named in a JSON file; config/frames.example.json"));
  EXPECT_THROW(import_session({folder / "absent.json", folder / "take"}), Error);
}

}  // namespace previz::exchange::import_description_test
