#include "daemon/core/session/session_toml.hpp"
#include "drivers/calibration/pose.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_toml_test {

SessionFile through_toml(const SessionFile& file) {
  return parse_session_toml(to_toml(file), "session.toml");
}

std::string error_of(const std::string& text) {
  return test::error_of([&] { parse_session_toml(text, "take/session.toml"); });
}

class AnyText : public testing::TestWithParam<std::string> {};

TEST_P(AnyText, ComesBackVerbatimAsTheSet) {
  SessionFile file;
  file.info.set_text = GetParam();
  EXPECT_EQ(through_toml(file).info.set_text, GetParam());
}

using namespace std::string_literals;
INSTANTIATE_TEST_SUITE_P(
    Texts, AnyText,
    testing::Values("", "\n", "\n\n", "a", "[set]\nname = \"x\" # comment\n",
                    "no newline at the end", "text = '''\nnested\n'''\n", "ends with a quote'",
                    "ends with two''", "'''", "''''''", "\"\"\"\n", "\\ back\\slash \\n \\u0041\n",
                    "windows\r\nlines\r\n", "old mac\rlines\r", "tab\tbell\a escape\x1b del\x7f\n",
                    "nul\0inside"s, "\0"s, "h\xc3\xa9llo \xe2\x82\xac \xf0\x9f\x8e\xac\n",
                    "\ufeffbyte order mark\n", "a\n\ufeffb", "latin1 \xe9\xff\n", "\xc3",
                    "\xed\xa0\x80 surrogate", "\xc0\x80 overlong",
                    "\xc2\x85 next line \xe2\x80\xa8 line separator\n",
                    std::string(300'000, 'x') + "\n"));

TEST(SessionToml, RandomBytesComeBackAsTheSet) {
  std::mt19937 random(1);
  for (int round = 0; round < 300; ++round) {
    SessionFile file;
    const auto length = random() % 40;
    // Half of the rounds over a small alphabet of what is special in TOML.
    const std::string special = "'\"\\\n\r\t#[]= \0a"s;
    for (std::size_t i = 0; i < length; ++i)
      file.info.set_text +=
          round % 2 ? static_cast<char>(random()) : special[random() % special.size()];
    EXPECT_EQ(through_toml(file).info.set_text, file.info.set_text) << "round " << round;
  }
}

TEST(SessionToml, AnOrdinarySetStaysReadable) {
  SessionFile file;
  file.info.set_text = "[observer]\ndriver = \"replay\"\n";
  EXPECT_THAT(to_toml(file), HasSubstr("'''\n[observer]\ndriver = \"replay\"\n'''"));
}

TEST(SessionToml, EveryNumberComesBackBitForBit) {
  SessionFile file;
  file.info.name = "take \"7\"\n";
  file.info.clock = "ptp";
  file.closed = true;
  file.streams["observer"] = {PixelFormat::yuv422p8, 1920, 1080, 1234567};
  file.streams["light"] = {PixelFormat::gray16, 512, 512, {}};
  ObserverCalibration observer;
  constexpr double least = std::numeric_limits<double>::denorm_min(), third = 1.0 / 3.0;
  observer.intrinsics = {1920,  1080, 612.1, 613.3, third, 236.4, -0.118,
                         0.041, 9e-4, -7e-4, least, 0.09,  -0.0,  third};
  observer.lens = ThinLens{0.0235, 2.0, 0.78};
  observer.response.kind = ResponseCurve::Kind::gamma;
  observer.response.gamma = 1.0 / 0.45;
  observer.responsivity = 1e11 + 1e-5;
  file.info.observer = observer;
  LightCameraCalibration light;
  light.intrinsics = {512,   512,   145.5312799632291,      145.5,
                      255.5, 255.5, {0.1, -0.2, 0.3, -0.0}, 1.7453292519943295};
  light.response.kind = ResponseCurve::Kind::table;
  light.response.inverse_table = {0, 0.1, 0.30000000000000004, 1};
  light.vignetting = {-0.1, 0.05, -0.02};
  light.dark_level = {0.01, 1.0 / 3, 0};
  light.world_from_camera = pose({1.0 / 3, std::sqrt(2), -0.1}, {0.3, -1.2, 2.5});
  file.info.light = light;
  file.info.assets = {{"a.glb", "assets/1.glb"}, {"dir \"q\"/b.glb", "assets/2.glb"}};

  const SessionFile back = through_toml(file);
  EXPECT_EQ(to_toml(back), to_toml(file));  // CalibrationsAreWrittenAsEver shows what is in it
  EXPECT_EQ(back.info.name, file.info.name);
  EXPECT_EQ(back.info.assets, file.info.assets);
  const PinholeIntrinsics &in = observer.intrinsics, &out = back.info.observer->intrinsics;
  for (const auto member : {&PinholeIntrinsics::fx, &PinholeIntrinsics::fy, &PinholeIntrinsics::cx,
                            &PinholeIntrinsics::cy, &PinholeIntrinsics::k1, &PinholeIntrinsics::k2,
                            &PinholeIntrinsics::p1, &PinholeIntrinsics::p2, &PinholeIntrinsics::k3,
                            &PinholeIntrinsics::k4, &PinholeIntrinsics::k5, &PinholeIntrinsics::k6})
    EXPECT_EQ(std::bit_cast<std::uint64_t>(out.*member), std::bit_cast<std::uint64_t>(in.*member));
  EXPECT_EQ(back.info.observer->responsivity, 1e11 + 1e-5);
  EXPECT_EQ(back.info.light->world_from_camera, light.world_from_camera);
  EXPECT_EQ(back.info.light->response.inverse_table, light.response.inverse_table);
}

TEST(SessionToml, ErrorsNameFileLineAndKey) {
  SessionFile file;
  file.streams["observer"] = {PixelFormat::rgb8, 640, 480, {}};
  file.info.observer = ObserverCalibration{};
  PinholeIntrinsics& film = file.info.observer->intrinsics;
  film.width = film.height = 9;
  film.fx = film.fy = 5;
  file.info.light = LightCameraCalibration{};
  FisheyeIntrinsics& fisheye = file.info.light->intrinsics;
  fisheye.width = fisheye.height = 9;
  fisheye.fx = fisheye.fy = 5;
  const std::string good = to_toml(file);
  EXPECT_EQ(error_of(good), "");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return error_of(text);
  };
  for (const char* number : {"1.0", "1.2e41", "nan"})
    EXPECT_THAT(with("format_version = 1", std::string("format_version = ") + number),
                HasSubstr("session.toml:2: format_version must be"));
  struct Mistake {
    const char *from, *to, *words;
  };
  for (const auto& [from, to, words] : {
           Mistake{"format_version = 1", "format_version = 3", "session.toml:2: format_version"},
           Mistake{"format = \"rgb8\"", "format = \"nv12\"", "observer.video.format"},
           Mistake{"width = 640", "width = -640", "observer.video.width"},
           Mistake{"[set]", "[[set]]", "set must be a table"},
       })
    EXPECT_THAT(with(from, to), HasSubstr(words)) << to;
  // Sessions of before these were known.
  EXPECT_EQ(with("vignetting = [0.0, 0.0, 0.0]\n", ""), "");
  EXPECT_EQ(with("dark_level = [0.0, 0.0, 0.0]\n", ""), "");
  EXPECT_THAT(error_of("garbage"), HasSubstr("take/session.toml:1:"));
  EXPECT_THAT(error_of(""), HasSubstr("format_version is missing"));
  for (std::size_t length = 0; length + 1 < good.size(); ++length)  // never anything but an Error
    static_cast<void>(error_of(good.substr(0, length)));
}

// Sessions are read for ever, and by other programs: keys may be added, but what is written of the
// others must not change by a byte.
TEST(SessionToml, CalibrationsAreWrittenAsEver) {
  SessionFile file;
  ObserverCalibration observer;
  observer.intrinsics = {64, 48, 60.1, 1.0 / 3, 31.5, 23, -0.1, 0.03, 1e-3, -2e-22, 0};
  observer.lens = ThinLens{0.0353, 2.8, 1e6};
  observer.response = {ResponseCurve::Kind::gamma, 2.4, {}};
  observer.responsivity = 3.5;
  file.info.observer = observer;
  LightCameraCalibration light;
  light.intrinsics = {64, 60, 20.1, 20, 31.5, 29.5, {-0.01, 0, -0.0, 0}, 100 * (M_PI / 180)};
  light.response = {ResponseCurve::Kind::table, 2.2, {0, 0.25, 1}, 0.93};
  light.vignetting = {-0.05, 0, 0.001};
  light.dark_level = {0.01, 0.02, 0};
  light.world_from_camera = glm::dmat4(0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.5, 0, 1.6, 1);
  file.info.light = light;
  EXPECT_THAT(to_toml(file), HasSubstr(R"(
[observer.calibration]  # pixels; Brown-Conrady in OpenCV's order
width = 64
height = 48
fx = 60.1
fy = 0.3333333333333333
cx = 31.5
cy = 23.0
k1 = -0.1
k2 = 0.03
p1 = 0.001
p2 = -2e-22
k3 = 0.0
responsivity = 3.5

[observer.calibration.response]
kind = "gamma"
gamma = 2.4
clip_share = 0.98

[observer.calibration.lens]
focal_length_m = 0.0353
f_number = 2.8
focus_distance_m = 1e+06

[light.calibration]  # pixels; Kannala-Brandt
width = 64
height = 60
fx = 20.1
fy = 20.0
cx = 31.5
cy = 29.5
k = [-0.01, 0.0, -0.0, 0.0]
max_angle_rad = 1.7453292519943295
world_from_camera = [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.6, 0.0, 0.0, 0.0, 1.0]  # row-major, metres
responsivity = 1.0
vignetting = [-0.05, 0.0, 0.001]
dark_level = [0.01, 0.02, 0.0]

[light.calibration.response]
kind = "table"
inverse_table = [0.0, 0.25, 1.0]
clip_share = 0.93

[assets])"));
}

TEST(SessionToml, RationalTermsAreWrittenIfOneIsNotZero) {
  SessionFile file;
  ObserverCalibration observer;
  observer.intrinsics = {64, 48, 60, 60, 31.5, 23, -0.1, 0.03, 1e-3, 0, 0};
  file.info.observer = observer;
  EXPECT_THAT(to_toml(file), Not(HasSubstr("k4")));
  file.info.observer->intrinsics.k5 = 0.25;
  EXPECT_THAT(to_toml(file), HasSubstr("k3 = 0.0\nk4 = 0.0\nk5 = 0.25\nk6 = 0.0\nresponsivity"));
}

TEST(SessionToml, WhatIsMissingComesBack) {
  SessionFile file;
  file.info.missing_assets = {
      {"c.glb", "/set/c.glb", "", "it cannot be opened"},
      {"models/a \"b\".glb", "/set/models/a.glb", std::string(64, 'a'), "the disk\nis full"}};
  file.lost = {3, 2, 1};
  EXPECT_EQ(through_toml(file).info.missing_assets, file.info.missing_assets);
  EXPECT_EQ(through_toml(file).lost, file.lost);
  // Names of files need not be UTF-8, and a count need not fit an integer of TOML.
  file.info.missing_assets = {{"c.glb", "/set/\xff.glb", "", "why"}};
  file.lost.frames = std::numeric_limits<std::uint64_t>::max();
  EXPECT_EQ(through_toml(file).info.missing_assets[0].file, "/set/?.glb");
  EXPECT_EQ(through_toml(file).lost.frames, std::uint64_t{INT64_MAX});
}

TEST(SessionToml, NamesMustBeText) {
  SessionFile file;
  file.info.name = "\xff";
  EXPECT_THROW(to_toml(file), Error);
}

}  // namespace previz::session::session_toml_test
