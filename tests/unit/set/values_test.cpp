// What a correct set file means: units, poses, corners, paths.
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/pose.hpp"
#include "daemon/core/set/set.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::set::values_test {

// Products of a few double operations on values of order 1.
constexpr double rounding = 1e-14;

void expect_near(const glm::dvec4& actual, const glm::dvec4& expected, double tolerance) {
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

Set parse(const std::string& text) {
  return parse_set(text, "folder/stage.toml");
}

// The only tag of a set, with these keys.
Tag tag_of(const std::string& keys) {
  return parse("[[tag]]\nid = 1\n" + keys).tracking.tags.at(0);
}

TEST(SetValues, EmptyFileIsTheDefaults) {
  const auto set = parse("");
  EXPECT_EQ(set.name, "stage");
  EXPECT_EQ(set.file, "folder/stage.toml");
  EXPECT_EQ(set.quality.samples, Quality{}.samples);
  EXPECT_EQ(set.output.directory, "folder/out");
}

TEST(SetValues, AFolderIsTheSameWithASlashAtItsEnd) {
  const auto set = parse(
      "[recording]\ndirectory='takes/'\nsecond_directory='/second//takes/'\n"
      "[output]\ndirectory='/'\n");
  EXPECT_EQ(set.recording.directory, "folder/takes");
  EXPECT_EQ(set.recording.second_directory, "/second/takes");
  EXPECT_EQ(set.output.directory, "/");
}

TEST(SetValues, StepsOfThePreviewStayInTheirOrder) {
  const auto set =
      parse("quality = {fps = 25, preview = [{samples = 4, denoise = false}, {scale = 0.5}]}");
  EXPECT_EQ(set.quality.fps, 25);
  EXPECT_EQ(set.quality.steps, (std::vector<PreviewStep>{{4, 1, false}, {1, 0.5, {}}}));
}

TEST(SetValues, AnOverlayReplacesKeysAndAllStepsTogether) {
  const char* own = R"(
quality = {fps = 25, samples = 8, preview = [{samples = 4}]}
estimator = {max_depth = 5}
)";
  const Overlay with{"live.toml",
                     "[quality]\nfps = 50\n[[quality.preview]]\nscale = 0.5\n"
                     "[[quality.preview]]\nscale = 0.25\n[lighting]\nmode = 'hybrid'\n"};
  const Set set = parse_set(own, "folder/stage.toml", {}, Origin::crew, with);
  EXPECT_EQ(set.quality.fps, 50);
  EXPECT_EQ(set.quality.samples, 8);
  EXPECT_EQ(set.quality.steps, (std::vector<PreviewStep>{{1, 0.5, {}}, {1, 0.25, {}}}));
  EXPECT_EQ(set.estimation.max_depth, 5);
  EXPECT_EQ(set.lighting.mode, LightMode::hybrid);
  EXPECT_EQ(set.file, "folder/stage.toml");
}

TEST(SetValues, AreInUnitsOfTheStructs) {
  const auto set = parse(R"(
[observer]
exposure = 2
intrinsics = {width = 640, height = 480, fx = 612, fy = 613.5, cx = 319.5, cy = 239.5, k1 = -0.1}
lens = {focal_length_mm = 35, f_number = 2.8, focus_distance_m = 1.25}
response = {kind = "table", table = [0, 0.25, 1], responsivity = 3.5}
[light_camera.intrinsics]
width = 512
height = 512
fx = 145.5
fy = 145.5
cx = 255.5
cy = 255.5
k = [0.01, 0, 0, 0]
max_angle_deg = 100
vignetting = [-0.05, 0, 0.001]
[light_camera]
response = {kind = "gamma", gamma = 2.4, dark_level = [0.01, 0.02, 0.01]}
pose = {position_m = [1, 2, 3]}
[lighting]
environment_rotation_deg = -90
unseen = "constant"
unseen_radiance = [0.1, 0.2, 0.3]
smoothing_s = 2
clipped_gain = 8
[lighting.room]
size_m = [6, 5, 3]
position_m = [1, 0, 1.5]
rotation_deg = [0, 0, 90]
seen_from_m = [0, 0, 0.1]
[[light]]
type = "spot"
position_m = [0, 0, 2]
direction = [0, 3, -4]
emission = [1, 2, 3]
outer_cone_deg = 30
gain_real = 1
tint = [1, 0.8, 0.6]
)");
  EXPECT_EQ(set.observer.exposure, 2.0);
  const auto& observer = set.observer.calibration.value();
  EXPECT_EQ(observer.intrinsics.fy, 613.5);
  EXPECT_EQ(observer.intrinsics.k1, -0.1);
  EXPECT_DOUBLE_EQ(observer.lens.value().focal_length_m, 0.035);
  EXPECT_EQ(observer.lens->focus_distance_m, 1.25);
  EXPECT_EQ(observer.response.kind, ResponseCurve::Kind::table);
  EXPECT_EQ(observer.response.inverse_table, (std::vector{0.0, 0.25, 1.0}));
  EXPECT_EQ(observer.responsivity, 3.5);
  const auto& light = set.light_camera.calibration.value();
  EXPECT_DOUBLE_EQ(light.intrinsics.max_angle_rad, 100 * std::numbers::pi / 180);
  EXPECT_EQ(light.intrinsics.k[0], 0.01);
  EXPECT_EQ(light.response.gamma, 2.4);
  EXPECT_EQ(light.vignetting, (Vignetting{-0.05, 0, 0.001}));
  EXPECT_EQ(light.dark_level, glm::dvec3(0.01, 0.02, 0.01));
  expect_near(light.world_from_camera[3], {1, 2, 3, 1}, 0);
  EXPECT_DOUBLE_EQ(set.lighting.environment_rotation_rad, -std::numbers::pi / 2);
  EXPECT_EQ(set.lighting.unseen_radiance.z, 0.3);
  EXPECT_EQ(set.lighting.smoothing_s, 2);
  EXPECT_EQ(set.lighting.clipped_gain, 8);
  const Room& room = set.lighting.room.value();
  EXPECT_EQ(room.size_m, glm::dvec3(6, 5, 3));
  EXPECT_EQ(room.world_from_room[3], glm::dvec4(1, 0, 1.5, 1));
  EXPECT_NEAR(room.world_from_room[0][1], 1, rounding);
  EXPECT_EQ(room.seen_from, glm::dvec3(0, 0, 0.1));
  ASSERT_EQ(set.lights.size(), 1u);
  EXPECT_EQ(set.lights[0].name, "light 1");
  EXPECT_NEAR(set.lights[0].direction.y, 0.6, rounding);
  EXPECT_NEAR(set.lights[0].direction.z, -0.8, rounding);
  EXPECT_DOUBLE_EQ(set.lights[0].outer_cone_rad, std::numbers::pi / 6);
  EXPECT_EQ(set.lights[0].gain_mixed, 1);
  EXPECT_EQ(set.lights[0].gain_real, 1);
  EXPECT_EQ(set.lights[0].tint, glm::dvec3(1, 0.8, 0.6));
}

TEST(SetValues, LookTheSameInline) {
  const auto set = parse(
      "quality = {samples = 3}\n"
      "tag = [{id = 2, size_m = 0.1, position_m = [0, 0, 0]}]\n"
      "observer.driver = 'none'\n");
  EXPECT_EQ(set.quality.samples, 3);
  ASSERT_EQ(set.tracking.tags.size(), 1u);
  EXPECT_EQ(set.tracking.tags[0].id, 2);
  EXPECT_EQ(set.observer.driver, no_driver);
}

// A take that was recorded with a button nobody could press is rendered all the same.
TEST(SetValues, SetsOfSessionsMayNameButtonsThatNoDriverTakes) {
  const std::string text = "[[button]]\nname = 'pedal:left'\naction = 'record'\n";
  EXPECT_THROW(parse_set(text, "stage.toml"), Error);
  const Set set = parse_set(text, "stage.toml", {}, Origin::session);
  EXPECT_EQ(set.buttons.at(0).name, "pedal:left");
}

// A take comes from anywhere: it names no file but its own, by whatever way, unless it is trusted.
TEST(SetValues, SetsOfSessionsNameFilesOfTheirOwnFolderOnly) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path take = directory / "take", outside = directory / "key.glb";
  std::filesystem::create_directories(take / "assets");
  for (const auto& file : {outside, take / "own.glb"}) std::ofstream(file) << "x";
  std::filesystem::create_symlink(outside, take / "link.glb");
  const auto parse_with = [&](const std::string& file, Origin origin) {
    return parse_set("[[object]]\nname = 'a'\npresence = 'virtual'\nfile = '" + file + "'\n",
                     take / "set.toml", {}, origin);
  };
  EXPECT_NO_THROW(parse_with("own.glb", Origin::session));
  EXPECT_NO_THROW(parse_with("assets/../own.glb", Origin::session));
  for (const std::string& file : {outside.string(), std::string("../key.glb"),
                                  std::string("link.glb"), std::string("/dev/zero")})
    EXPECT_THROW(parse_with(file, Origin::session), Error) << file;
  for (const Origin trusted : {Origin::crew, Origin::trusted_session})
    for (const std::string& file : {outside.string(), std::string("../key.glb")})
      EXPECT_NO_THROW(parse_with(file, trusted)) << file;
}

TEST(SetValues, RotationTurnsAboutWorldXThenYThenZ) {
  const auto m =
      tag_of("size_m = 0.1\nposition_m = [1, 2, 3]\nrotation_deg = [90, 0, 90]\n").world_from_tag;
  // X turns nothing of the tag's right; Z then turns it to +Y. Up goes to +Z and stays there. Out
  // of the paper goes to -Y and on to +X.
  expect_near(m[0], {0, 1, 0, 0}, rounding);
  expect_near(m[1], {0, 0, 1, 0}, rounding);
  expect_near(m[2], {1, 0, 0, 0}, rounding);
  expect_near(m[3], {1, 2, 3, 1}, rounding);
}

TEST(SetValues, WallTagFacesMinusY) {
  const Tag tag = tag_of("size_m = 0.1\nposition_m = [0, 0, 1]\nrotation_deg = [90, 0, 0]\n");
  expect_near(tag.world_from_tag[2], {0, -1, 0, 0}, rounding);
}

TEST(SetValues, MatricesAreRowMajor) {
  for (const char* matrix : {"[[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]",
                             "[0, -1, 0, 1,  1, 0, 0, 2,  0, 0, 1, 3,  0, 0, 0, 1]"}) {
    const Tag tag = tag_of("size_m = 0.1\nworld_from_tag = " + std::string(matrix));
    expect_near(tag.world_from_tag[0], {0, 1, 0, 0}, 0);
    expect_near(tag.world_from_tag[3], {1, 2, 3, 1}, 0);
  }
}

// A pose typed with 4 digits is off by up to 5e-5 an entry: taken, and made exactly rigid, moving
// no entry by more than the error that was tolerated.
TEST(SetValues, RoundedPosesBecomeExactlyRigid) {
  const Tag tag = tag_of(
      "size_m = 0.1\n"
      "world_from_tag = [[0.8660, -0.5, 0, 0], [0.5, 0.8660, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  const auto& m = tag.world_from_tag;
  EXPECT_LT(rigidity_error(m), rounding);
  EXPECT_NEAR(m[0][0], 0.8660, rigid_tolerance);
  EXPECT_NEAR(m[0][1], 0.5, rigid_tolerance);
}

TEST(SetValues, CornersGiveSizeAndPose) {
  const Tag tag = tag_of("corners_m = [[1, 0, 2.0], [1, 0.1, 2.0], [1, 0.1, 2.1], [1, 0, 2.1]]\n");
  EXPECT_NEAR(tag.size_m, 0.1, rounding);
  expect_near(tag.world_from_tag[0], {0, 1, 0, 0}, rounding);
  expect_near(tag.world_from_tag[1], {0, 0, 1, 0}, rounding);
  expect_near(tag.world_from_tag[2], {1, 0, 0, 0}, rounding);
  expect_near(tag.world_from_tag[3], {1, 0.05, 2.05, 1}, rounding);
}

// Corners measured with a tape, each off by at most e: the fitted middle is their mean and at most
// e off; the fitted side is a mean of four differences, at most 2e off.
TEST(SetValues, MeasuredCornersAreFitted) {
  constexpr double e = 0.001;
  const Tag tag = tag_of(
      "size_m = 0.1\n"
      "corners_m = [[0.001, 0, 0], [0.1, 0.001, 0], [0.1, 0.1, 0.001], [0, 0.099, 0]]\n");
  EXPECT_EQ(tag.size_m, 0.1);  // what was measured along the edge wins
  EXPECT_LT(rigidity_error(tag.world_from_tag), rounding);
  expect_near(tag.world_from_tag[3], {0.05, 0.05, 0, 1}, e);
}

TEST(SetValues, FilesAreRelativeToTheSetAndAssetsStandIn) {
  test::TemporaryDirectory directory;
  std::filesystem::create_directories(directory / "assets");
  std::ofstream(directory / "vase.glb") << "glTF";
  std::ofstream(directory / "assets/abc.glb") << "glTF";
  const auto file = directory / "stage.toml";
  const std::string text =
      "[observer]\ndevice = 'takes/1'\n"
      "[[object]]\nname = 'vase'\nfile = 'vase.glb'\npresence = 'removed'\n"
      "position_m = [1, 0, 0]\nrotation_deg = [0, 0, 90]\nscale = 2\n";
  const auto set = parse_set(text, file);
  EXPECT_EQ(set.objects.at(0).file, directory / "vase.glb");
  EXPECT_EQ(set.objects[0].file_as_written, "vase.glb");
  EXPECT_EQ(set.objects[0].presence, Presence::removed);
  expect_near(set.objects[0].world_from_file[0], {0, 2, 0, 0}, rounding);
  expect_near(set.objects[0].world_from_file[3], {1, 0, 0, 1}, rounding);
  EXPECT_EQ(set.observer.device, (directory / "takes/1").string());

  const auto replayed = parse_set(text, file, {{"vase.glb", "assets/abc.glb"}});
  EXPECT_EQ(replayed.objects.at(0).file, directory / "assets/abc.glb");
  EXPECT_EQ(replayed.objects[0].file_as_written, "vase.glb");
}

TEST(SetValues, RectangleGetsAnUpAcrossItsDirection) {
  const auto set = parse(
      "[[light]]\ntype = 'rectangle'\nposition_m = [0, 0, 0]\ndirection = [0, 1, 0]\n"
      "width_m = 1\nheight_m = 2\nemission = [1, 1, 1]\n"
      "[[light]]\ntype = 'rectangle'\nposition_m = [0, 0, 0]\ndirection = [0, 0, -2]\n"
      "up = [3, 0, 1]\nwidth_m = 1\nheight_m = 2\nemission = [1, 1, 1]\n");
  EXPECT_EQ(set.lights.at(0).up, glm::dvec3(0, 0, 1));
  EXPECT_EQ(set.lights.at(1).up, glm::dvec3(1, 0, 0));
}

// A stick with one tag, which is its frame, and a tray with two.
TEST(SetValues, CarriersAreWhatTagsAreStuckTo) {
  const auto set = parse(R"(
tag = [{id = 1, size_m = 0.08, position_m = [0, 0, 0]},
       {id = 5, size_m = 0.05, carrier = "stick"},
       {id = 6, size_m = 0.05, carrier = "tray", position_m = [0.1, 0, 0]},
       {id = 7, carrier = "tray", corners_m = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]}]
light = [{type = "point", emission = [1, 1, 1], position_m = [0, 0, 0.1], carrier = "stick"}]
)");
  ASSERT_EQ(set.tracking.tags.size(), 1u);
  ASSERT_EQ(set.tracking.carriers.size(), 2u);
  const Carrier &stick = set.tracking.carriers[0], &tray = set.tracking.carriers[1];
  EXPECT_EQ(stick.name, "stick");
  ASSERT_EQ(stick.tags.size(), 1u);
  EXPECT_EQ(stick.tags[0].world_from_tag, glm::dmat4(1));
  ASSERT_EQ(tray.tags.size(), 2u);
  EXPECT_EQ(tray.tags[0].world_from_tag[3], glm::dvec4(0.1, 0, 0, 1));
  EXPECT_NEAR(tray.tags[1].size_m, 1, rounding);
  EXPECT_EQ(set.lights.at(0).carrier, "stick");
}

// A real lamp is in the light camera's picture unless the set says otherwise; in the picture of an
// environment file it is only where the set says so.
TEST(SetValues, RealLampsAreTakenOutOfTheCapturedLight) {
  const auto lamp = [](const std::string& keys, const std::string& more = "") {
    return parse("[[light]]\ntype = \"point\"\nposition_m = [0, 0, 1]\n" + keys + more).lights[0];
  };
  const std::string emits = "emission = [1, 1, 1]\n";
  EXPECT_FALSE(lamp(emits).captured);
  EXPECT_TRUE(lamp(emits + "gain_real = 1\n").captured);
  EXPECT_FALSE(lamp(emits + "gain_real = 1\n").measured);
  EXPECT_TRUE(lamp("gain_real = 1\n").measured);
  EXPECT_FALSE(lamp(emits + "gain_real = 1\ncaptured = false\n").captured);
  EXPECT_FALSE(lamp(emits + "gain_real = 1\n", "[lighting]\nfrom = \"set\"\n").captured);
  const Light wide = lamp("gain_real = 1\ncone_deg = 9\ntint = [1, 0.5, 0.25]\n");
  EXPECT_NEAR(wide.cone_rad, 9 * std::numbers::pi / 180, rounding);
  EXPECT_EQ(wide.tint, glm::dvec3(1, 0.5, 0.25));
  const Set set = parse(
      "[[captured_light]]\nname = \"window\"\ndirection = [0, 3, 4]\ncone_deg = 18\n"
      "[[captured_light]]\nname = \"bulb\"\nposition_m = [1, 2, 3]\ncone_deg = 2\n");
  ASSERT_EQ(set.captured_lamps.size(), 2u);
  EXPECT_LT(glm::length(set.captured_lamps[0].direction - glm::dvec3(0, 0.6, 0.8)), rounding);
  EXPECT_EQ(set.captured_lamps[1].position, glm::dvec3(1, 2, 3));
}

}  // namespace previz::set::values_test
