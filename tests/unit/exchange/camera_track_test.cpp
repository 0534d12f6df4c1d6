// The exported camera against matrices that are known, and against what OpenCV's model projects.
#include "daemon/tools/exchange/camera_track.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::exchange::camera_track_test {

using testing::_;
using testing::ContainsRegex;

// At (1, 2, 3), level, looking along the world's +Y: right = X, down = -Z, forward = Y.
const glm::dmat4 along_y{{1, 0, 0, 0}, {0, 0, -1, 0}, {0, 1, 0, 0}, {1, 2, 3, 1}};

CameraTrack track_of(const glm::dmat4& world_from_camera) {
  CameraTrack track;
  track.name = "12A \"close\"";
  track.calibration.intrinsics = {1920, 1080, 1800, 1790, 959.5, 539.5, -0.08, 0, 0, 0, 0};
  track.calibration.lens = ThinLens{0.035, 2.8, 1.5};
  track.frames = 11;
  track.keys = {{7, world_from_camera}};
  return track;
}

double value_of(const std::string& usda, const std::string& name) {
  std::smatch found;
  EXPECT_TRUE(std::regex_search(usda, found, std::regex("float " + name + " = (\\S+)\n"))) << name;
  return std::stod(found[1]);
}

// A USD camera that looks along +Y with Z up is turned about X by a quarter: by the quaternion
// cos(45), sin(45), 0, 0. The camera lies in what moves, for readers that take no samples from a
// camera's own transform.
TEST(CameraTrack, UsdOfALevelCamera) {
  const std::string usda = to_usda(track_of(along_y));
  EXPECT_THAT(usda, HasSubstr("translate.timeSamples = {\n        7: (1, 2, 3),"));
  std::smatch turn;
  ASSERT_TRUE(std::regex_search(usda, turn, std::regex(R"(7: \((\S+), (\S+), 0, 0\),)")));
  for (const int i : {1, 2}) EXPECT_NEAR(std::stod(turn[i]), std::sqrt(0.5), 1e-15);
  EXPECT_THAT(usda, ContainsRegex("def Xform \"camera\"(.|\n)*def Camera \"lens\""));
  EXPECT_THAT(usda, HasSubstr("upAxis = \"Z\""));
  EXPECT_THAT(usda, HasSubstr("endTimeCode = 10\n"));
  EXPECT_THAT(usda, HasSubstr("12A \\\"close\\\""));
  EXPECT_THAT(usda, HasSubstr("Brown-Conrady: k1 -0.08"));
  EXPECT_THAT(usda, Not(HasSubstr("k4")));
  CameraTrack wide = track_of(along_y);
  wide.calibration.intrinsics.k5 = 0.25;
  EXPECT_THAT(to_usda(wide), HasSubstr("rational model: k1 -0.08"));
  EXPECT_THAT(to_usda(wide), HasSubstr(", k4 0, k5 0.25, k6 0"));
}

// The lens is 35 mm; the film is as wide as the picture at that distance.
TEST(CameraTrack, UsdLensIsTheCalibration) {
  CameraTrack track = track_of(along_y);
  track.calibration.intrinsics.cx = 969.5;  // the axis meets the picture 10 px right of its middle,
  track.calibration.intrinsics.cy = 529.5;  // and 10 px above
  const std::string usda = to_usda(track);
  EXPECT_DOUBLE_EQ(value_of(usda, "focalLength"), 0.35);
  EXPECT_DOUBLE_EQ(value_of(usda, "horizontalAperture"), 0.35 * 1920 / 1800);
  EXPECT_DOUBLE_EQ(value_of(usda, "verticalAperture"), 0.35 * 1080 / 1790);
  EXPECT_DOUBLE_EQ(value_of(usda, "horizontalApertureOffset"), 0.35 * -10 / 1800);
  EXPECT_DOUBLE_EQ(value_of(usda, "verticalApertureOffset"), 0.35 * -10 / 1790);
  EXPECT_DOUBLE_EQ(value_of(usda, "fStop"), 2.8);
  EXPECT_DOUBLE_EQ(value_of(usda, "focusDistance"), 1.5);
  track.calibration.lens.reset();
  EXPECT_DOUBLE_EQ(value_of(to_usda(track), "horizontalAperture"), 0.36);
}

// The numbers of a .chan file's only line: frame, place, angles about X, Y and Z, vertical angle.
std::vector<double> chan_of(const glm::dmat4& world_from_camera) {
  std::istringstream line(to_chan(track_of(world_from_camera)));
  return {std::istream_iterator<double>(line), {}};
}

auto near(double value) {
  return testing::DoubleNear(value, 1e-12);
}

// Two turns by a little more and less than half a turn: between them lie a few degrees.
TEST(CameraTrack, UsdTurnsTheShortWay) {
  CameraTrack track = track_of(glm::rotate(glm::dmat4(1), glm::radians(178.0), {0, 0, 1}));
  track.keys.push_back({8, glm::rotate(glm::dmat4(1), glm::radians(183.0), {0, 0, 1})});
  const std::string usda = to_usda(track);
  std::array<glm::dvec4, 2> turns{};
  const std::string orient = usda.substr(usda.find("orient.timeSamples"));
  for (const int i : {0, 1}) {
    std::smatch found;
    const std::regex form(std::to_string(7 + i) + R"(: \((\S+), (\S+), (\S+), (\S+)\),)");
    ASSERT_TRUE(std::regex_search(orient, found, form));
    for (int n = 0; n < 4; ++n) turns[i][n] = std::stod(found[n + 1]);
  }
  EXPECT_NEAR(glm::dot(turns[0], turns[1]), std::cos(glm::radians(2.5)), 1e-12);
}

// Nuke's Camera has the picture's middle in its axis, and shifts the window: the angle does not
// depend on the principal point.
TEST(CameraTrack, ChanHasNukesAngle) {
  CameraTrack track = track_of(along_y);
  track.calibration.intrinsics = {256, 144, 300, 299.3, 130.2, 76.5, 0, 0, 0, 0, 0};
  std::istringstream line(to_chan(track));
  const std::vector<double> numbers{std::istream_iterator<double>(line), {}};
  EXPECT_NEAR(numbers.back(), glm::degrees(2 * std::atan(72 / 299.3)), 1e-12);
}

// Our +Y is Nuke's -Z, where an unturned camera looks.
TEST(CameraTrack, ChanOfALevelCameraHasNoRotation) {
  const double vertical_angle = glm::degrees(2 * std::atan(540.0 / 1790));
  EXPECT_THAT(chan_of(along_y),
              ElementsAre(7, 1, 3, -2, near(0), near(0), near(0), near(vertical_angle)));
}

TEST(CameraTrack, ChanOfACameraTippedDown) {
  const glm::dmat4 tipped = along_y * glm::rotate(glm::dmat4(1), glm::radians(-30.0), {1, 0, 0});
  // OpenCV's X is the same axis as Nuke's, its other two are turned round: the angle keeps its
  // sign.
  EXPECT_THAT(chan_of(tipped), ElementsAre(_, _, _, _, near(-30), near(0), near(0), _));
}

// Ry Rx Rz of the angles is the matrix they were taken from, also where the camera looks straight
// up.
TEST(CameraTrack, AnglesGiveTheMatrixBack) {
  const auto turn = [](double degrees, const glm::dvec3& axis) {
    return glm::dmat3(glm::rotate(glm::dmat4(1), glm::radians(degrees), axis));
  };
  for (const double x : {-90.0, -60.0, 0.0, 30.0, 90.0})
    for (const double y : {-170.0, -20.0, 0.0, 100.0})
      for (const double z : {-120.0, 0.0, 45.0, 180.0}) {
        const auto matrix = [&](const glm::dvec3& d) {
          return turn(d.y, {0, 1, 0}) * turn(d.x, {1, 0, 0}) * turn(d.z, {0, 0, 1});
        };
        const glm::dmat3 truth = matrix({x, y, z}), back = matrix(zxy_degrees(truth));
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(glm::length(truth[c] - back[c]), 0, 1e-7) << x << " " << y << " " << z;
      }
}

TEST(CameraTrack, FramesThatWereNotTrackedHaveNoKey) {
  session::Session session;
  session.track.resize(3);
  for (std::uint64_t i = 0; i < 3; ++i) session.track[i].frame = i;
  session.track[1].tracked = true;
  std::vector<session::FrameRecord> frames(3);
  for (std::size_t i = 0; i < 3; ++i)
    frames[i].timestamp_ns = static_cast<std::int64_t>(i) * 50'000'000;
  const CameraTrack track = camera_track(session, frames, {});
  ASSERT_EQ(track.keys.size(), 1u);
  EXPECT_EQ(track.keys[0].frame, 1u);
  EXPECT_DOUBLE_EQ(track.rate.fps, 20);
  session.track[1].tracked = false;
  EXPECT_THROW(camera_track(session, frames, {}), Error);
}

// A session in which `from` stands for what `to` says, wherever it is written.
void rewrite(const std::filesystem::path& session, const std::string& from, const std::string& to) {
  std::string text = test::content_of(session / "session.toml");
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  session::replace_file(session / "session.toml", text);
}

class ExportTake : public testing::Test {
 protected:
  ExportTake() { test::write_small_take(directory.path()); }

  test::TemporaryDirectory directory;
  std::ostringstream out;
};

TEST_F(ExportTake, TwoFilesOfOneNameStayTwo) {
  const std::string floor = test::content_of(directory / "floor.gltf");
  const std::string card = test::content_of(directory / "card.gltf");
  rewrite(directory / "session", "card.gltf", "props/floor.gltf");
  export_take({directory / "session", directory / "out"}, out);
  EXPECT_EQ(test::content_of(directory / "out/floor.gltf"), floor);
  EXPECT_EQ(test::content_of(directory / "out/floor_2.gltf"), card);
}

// What is exported is handed on: a take from elsewhere must not add files of the one who exports
// it.
TEST_F(ExportTake, CopiesNoForeignFile) {
  session::replace_file(directory / "secret.gltf", test::content_of(directory / "card.gltf"));
  rewrite(directory / "session", "\"card.gltf\"", "\"../secret.gltf\"");
  rewrite(directory / "session", "\\\"card.gltf\\\"", "\\\"../secret.gltf\\\"");
  // What the set names is no asset of the session any more.
  rewrite(directory / "session", "\"../secret.gltf\" =", "\"other.gltf\" =");
  EXPECT_THROW(export_take({directory / "session", directory / "out"}, out), Error);
  EXPECT_FALSE(std::filesystem::exists(directory / "out/secret.gltf"));
  export_take({directory / "session", directory / "out", {}, true}, out);
  EXPECT_TRUE(std::filesystem::exists(directory / "out/secret.gltf"));
}

}  // namespace previz::exchange::camera_track_test
