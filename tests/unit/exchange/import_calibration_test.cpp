// A calibration in each of its three formats: the same numbers give the same camera, and the same
// mistake gives the same words, at the place where it is.
#include <nlohmann/json.hpp>

#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/exchange/import_description.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::import_calibration_test {

const char* const set_text = R"([observer.intrinsics]
width = 64
height = 48
fx = 60.1
fy = 60.3
cx = 31.5
cy = 23.5
k1 = -0.1
k2 = 0.03
p1 = 0.001
p2 = -0.002
k3 = 0.004
k4 = 0.05
k5 = -0.006
k6 = 0.007
[observer.lens]
focal_length_mm = 35.3
f_number = 2.8
focus_distance_m = 1.2
[observer.response]
kind = "srgb"
responsivity = 3.5
[light_camera.intrinsics]
width = 64
height = 60
fx = 20.1
fy = 20.3
cx = 31.5
cy = 29.5
k = [-0.01, 0.0, 0.0, 0.0]
max_angle_deg = 97.3
vignetting = [-0.05, 0.0, 0.001]
[light_camera.response]
kind = "srgb"
responsivity = 2.5
clip_share = 0.93
dark_level = [0.01, 0.02, 0.01]
[light_camera.pose]
world_from_camera = [[0, -1, 0, 0.5], [1, 0, 0, 0], [0, 0, 1, 1.6], [0, 0, 0, 1]]
)";

const char* const frames_text = R"({
"observer": {
  "intrinsics": {"width": 64, "height": 48, "fx": 60.1, "fy": 60.3, "cx": 31.5, "cy": 23.5,
                 "k1": -0.1, "k2": 0.03, "p1": 0.001, "p2": -0.002, "k3": 0.004,
                 "k4": 0.05, "k5": -0.006, "k6": 0.007},
  "lens": {"focal_length_mm": 35.3, "f_number": 2.8, "focus_distance_m": 1.2},
  "response": {"kind": "srgb", "responsivity": 3.5},
  "pictures": ["a.png"], "fps": 25, "exposure": 1},
"light": {
  "intrinsics": {"width": 64, "height": 60, "fx": 20.1, "fy": 20.3, "cx": 31.5, "cy": 29.5,
                 "k": [-0.01, 0, 0, 0], "max_angle_deg": 97.3, "vignetting": [-0.05, 0, 0.001]},
  "response": {"kind": "srgb", "responsivity": 2.5, "clip_share": 0.93,
               "dark_level": [0.01, 0.02, 0.01]},
  "pose": {"world_from_camera": [[0, -1, 0, 0.5], [1, 0, 0, 0], [0, 0, 1, 1.6], [0, 0, 0, 1]]},
  "pictures": ["a.png"], "fps": 25, "exposure": 1}})";

std::string session_text() {
  const set::Set set = set::parse_set(set_text, "stage.toml");
  session::SessionFile file;
  file.info.observer = set.observer.calibration;
  file.info.light = set.light_camera.calibration;
  return session::to_toml(file);
}

exchange::ImportDescription describe(const std::string& json) {
  const test::TemporaryDirectory folder;
  std::ofstream(folder / "a.png") << "not decoded here";
  std::ofstream(folder / "FRAMES.json") << json;
  return exchange::read_description(folder / "FRAMES.json");
}

// `text` with another value for a key of a TOML table, a further key, or (value "") without it; and
// the line of the key, or of its table where the key is not there.
std::pair<std::string, int> edited(std::string text, const std::string& table,
                                   const std::string& key, const std::string& value) {
  const auto header = text.find("[" + table + "]");
  const auto body = text.find('\n', header);
  const auto end = std::min(text.find("\n[", body), text.size());
  auto at = text.find("\n" + key + " = ", body);
  if (at < end) {
    text.erase(at, text.find('\n', at + 1) - at);
  } else {
    at = body;
  }
  const auto place = value.empty() ? header : at + 1;
  const auto line = 1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(place), '\n');
  if (!value.empty()) text.insert(at, "\n" + key + " = " + value);
  return {text, int(line)};
}

struct Mistake {
  std::string camera, table, key;
  std::string value;  // "": left out
  std::string words;
  std::string kind = "srgb";  // of the response
  // Where session.toml differs.
  std::string recorded_key{}, recorded_value{}, recorded_words{};
};

const std::string& either(const std::string& own, const std::string& other) {
  return own.empty() ? other : own;
}

void PrintTo(const Mistake& mistake, std::ostream* out) {
  *out << mistake.camera << '.' << mistake.table << '.' << mistake.key << " = " << mistake.value;
}

class CalibrationMistake : public testing::TestWithParam<Mistake> {};

// The message begins with the place and the key, and goes on with the words.
void expect_words(const std::string& message, const std::string& place, const std::string& words) {
  const auto at = message.find(place);
  ASSERT_NE(at, std::string::npos) << message;
  EXPECT_EQ(message.substr(at + place.size(), words.size()), words) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

TEST_P(CalibrationMistake, IsReportedInTheSameWordsByASetFile) {
  const Mistake& m = GetParam();
  const std::string table = m.camera + "." + m.table;
  const auto kind = edited(set_text, m.camera + ".response", "kind", '"' + m.kind + '"').first;
  const auto [text, line] = edited(m.key == "kind" ? set_text : kind, table, m.key, m.value);
  const auto message = test::error_of([&, &its = text] { set::parse_set(its, "stage.toml"); });
  EXPECT_TRUE(message.starts_with("stage.toml:" + std::to_string(line) + ":")) << message;
  expect_words(message, ": " + table + "." + m.key + ": ", m.words);
}

TEST_P(CalibrationMistake, IsReportedInTheSameWordsByAnImport) {
  const Mistake& m = GetParam();
  const std::string camera = m.camera == "observer" ? "observer" : "light";
  nlohmann::json json = nlohmann::json::parse(frames_text);
  json[camera]["response"]["kind"] = m.kind;
  if (m.value.empty())
    json[camera][m.table].erase(m.key);
  else
    json[camera][m.table][m.key] = nlohmann::json::parse(m.value);
  expect_words(test::error_of([&] { describe(json.dump()); }),
               "FRAMES.json: " + camera + "." + m.table + "." + m.key + ": ", m.words);
}

TEST_P(CalibrationMistake, IsReportedInTheSameWordsByASession) {
  const Mistake& m = GetParam();
  const std::string table = m.camera == "observer" ? "observer.calibration" : "light.calibration";
  const bool is_flat = m.table == "intrinsics" || m.table == "pose" || m.key == "responsivity" ||
                       m.key == "dark_level";
  const std::string home = is_flat ? table : table + "." + m.table;
  const std::string key = either(m.recorded_key, m.key);
  const auto kind = edited(session_text(), table + ".response", "kind", '"' + m.kind + '"').first;
  const auto [text, line] =
      edited(m.key == "kind" ? session_text() : kind, home, key, either(m.recorded_value, m.value));
  expect_words(
      test::error_of([&, &its = text] { session::parse_session_toml(its, "session.toml"); }),
      "session.toml:" + std::to_string(line) + ": " + home + "." + key + ": ",
      either(m.recorded_words, m.words));
}

const std::string rising = "; allowed: at least 2 numbers, strictly increasing from 0 to 1";
Mistake table_of(const std::string& value, const std::string& words,
                 const std::string& kind = "table") {
  return {"observer", "response", "table", value, words, kind, "inverse_table"};
}

const Mistake observer_mistakes[] = {
    {"observer", "intrinsics", "width", "0", "0 is not allowed; allowed: whole number in px, 1 to"},
    {"observer", "intrinsics", "width", "16385", "16385 is not allowed; allowed: whole number"},
    {"observer", "intrinsics", "height", "48.5", "48.5 is not allowed; allowed: whole number"},
    {"observer", "intrinsics", "fx", "0", "0 is not allowed; allowed: finite number in px, 1 to 1"},
    {"observer", "intrinsics", "fx", "\"wide\"", "\"wide\" is not allowed; allowed: number in px"},
    {"observer", "intrinsics", "fy", "", "is missing; allowed: number in px, 1 to 1"},
    {"observer", "intrinsics", "cx", "[1]", "a list of 1 entry is not allowed; allowed: number"},
    {"observer", "intrinsics", "k1", "true", "true is not allowed; allowed: number"},
    {"observer", "intrinsics", "k4", "\"wide\"", "\"wide\" is not allowed; allowed: number"},
    {"observer", "intrinsics", "k6", "[1, 2]",
     "a list of 2 entries is not allowed; allowed: number"},
    {"observer", "lens", "focal_length_mm", "0",
     "0 is not allowed; allowed: finite number in mm, 0.01 to 10000", "srgb", "focal_length_m", "",
     "0 is not allowed; allowed: finite number in m, 1e-05 to 10"},
    {"observer", "lens", "f_number", "0.4", "0.4 is not allowed; allowed: finite number, 0.5 to"},
    {"observer", "lens", "f_number", "", "is missing; allowed: number, 0.5 to"},
    {"observer", "lens", "focus_distance_m", "0.03",
     "must exceed the focal length; allowed: above 0.0353 m"},
    {"observer", "response", "responsivity", "0",
     "0 is not allowed; allowed: finite number, 1e-12 to"},
    {"observer", "response", "kind", "\"log\"",
     "\"log\" is not allowed; allowed: \"srgb\" | \"linear\" | \"gamma\" | \"table\"", "log"},
    {"observer", "response", "gamma", "2.2",
     "conflicts with kind \"srgb\"; allowed with \"gamma\""},
    {"observer", "response", "gamma", "0", "0 is not allowed; allowed: finite number, 0.1 to 10",
     "gamma"},
    table_of("", "is missing for kind \"table\"" + rising),
    table_of("[0, 0.5, 0.5, 1]", "number 3 is not above the one before it" + rising),
    table_of("[0]", "does not run from 0 to 1" + rising),
    table_of("[0, 2, 1]", "2 is not allowed; allowed: finite number, 0 to 1"),
    table_of("[0, 1]", "conflicts with kind \"linear\"; allowed with \"table\"", "linear"),
};
INSTANTIATE_TEST_SUITE_P(Observer, CalibrationMistake, testing::ValuesIn(observer_mistakes));

const Mistake light_mistakes[] = {
    {"light_camera", "intrinsics", "fx", "-3", "-3 is not allowed; allowed: finite number in px"},
    {"light_camera", "intrinsics", "k", "[1, 2]",
     "a list of 2 entries is not allowed; allowed: 4 numbers in brackets"},
    {"light_camera", "intrinsics", "max_angle_deg", "181",
     "181 is not allowed; allowed: finite number in degrees, 1 to 180", "srgb", "max_angle_rad",
     "3.15", "3.15 is not allowed; allowed: finite number in rad, 0.0174532925199 to 3.1415"},
    {"light_camera", "intrinsics", "vignetting", "[-0.5, 0.0, 0.0]",
     "passes no light at some angle; allowed: at least 0.01 of it up to max_angle_deg", "srgb", "",
     "", "passes no light at some angle; allowed: at least 0.01 of it up to max_angle_rad"},
    {"light_camera", "response", "clip_share", "0.4",
     "0.4 is not allowed; allowed: finite number, 0.5 to 1"},
    {"light_camera", "response", "dark_level", "[0, 0.6, 0]",
     "0.6 is not allowed; allowed: finite number, 0 to 0.5"},
    {"light_camera", "pose", "world_from_camera",
     "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]",
     "mirrors or is singular; allowed: a rotation and a translation"},
    {"light_camera", "pose", "world_from_camera",
     "[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
     "is not rigid, its axes are off by 3.0; allowed: unit axes at right angles"},
    {"light_camera", "pose", "world_from_camera", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
     "a list of 3 entries is not allowed; allowed: 4 rows of 4 numbers"},
};
INSTANTIATE_TEST_SUITE_P(Light, CalibrationMistake, testing::ValuesIn(light_mistakes));

TEST(Calibration, IsTheSameCameraInEveryFormat) {
  const set::Set set = set::parse_set(set_text, "stage.toml");
  const exchange::ImportDescription imported = describe(frames_text);
  const auto recorded = session::parse_session_toml(session_text(), "session.toml").info;
  const auto text_of = [](const auto& observer, const auto& light) {
    session::SessionFile file;
    file.info.observer = observer;
    file.info.light = light;
    return session::to_toml(file);  // to the last bit
  };
  const auto text = text_of(set.observer.calibration, set.light_camera.calibration);
  EXPECT_EQ(text_of(imported.observer_calibration, imported.light_calibration), text);
  EXPECT_EQ(text_of(recorded.observer, recorded.light), text);
  EXPECT_EQ(set.observer.calibration->lens->focal_length_m, 35.3 * 1e-3);
  EXPECT_EQ(set.observer.calibration->intrinsics.k4, 0.05);
  EXPECT_EQ(set.observer.calibration->intrinsics.k5, -0.006);
  EXPECT_EQ(set.observer.calibration->intrinsics.k6, 0.007);
  EXPECT_EQ(set.light_camera.calibration->response.clip_share, 0.93);
  EXPECT_EQ(set.light_camera.calibration->world_from_camera[3], glm::dvec4(0.5, 0, 1.6, 1));
}

// JSON has no such numbers.
TEST(Calibration, DistortionThatIsNotFiniteIsRefused) {
  for (const char* key : {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"})
    for (const char* value : {"nan", "inf", "-inf"}) {
      const std::string words =
          std::string(key) + ": " + value + " is not allowed; allowed: finite number";
      const auto set = edited(set_text, "observer.intrinsics", key, value).first;
      EXPECT_THAT(test::error_of([&] { set::parse_set(set, "stage.toml"); }),
                  HasSubstr("observer.intrinsics." + words));
      const auto session = edited(session_text(), "observer.calibration", key, value).first;
      EXPECT_THAT(test::error_of([&] { session::parse_session_toml(session, "session.toml"); }),
                  HasSubstr("observer.calibration." + words));
    }
}

// The terms of the rational model are printed for the lenses that have them only.
TEST(Calibration, RationalTermsArePrintedIfTheyAreNotZero) {
  ObserverCalibration calibration = *set::parse_set(set_text, "stage.toml").observer.calibration;
  const std::string with = set::intrinsics_toml(calibration);
  EXPECT_THAT(with, HasSubstr("k3 = 0.004\nk4 = 0.05\nk5 = -0.006\nk6 = 0.007\n"));
  EXPECT_EQ(set::intrinsics_toml(*set::parse_set(with, "printed.toml").observer.calibration), with);
  PinholeIntrinsics& lens = calibration.intrinsics;
  lens.k4 = lens.k5 = lens.k6 = 0;
  const std::string without = set::intrinsics_toml(calibration);
  EXPECT_EQ(without, with.substr(0, with.find("k4 = ")));
}

// r = t - 0.2 t^3 stops growing at t = sqrt(1 / 0.6) = 73.97 degrees. Whoever wrote the file can
// correct it; a take that was recorded like that opens, and is used up to the fold.
TEST(Calibration, AFoldingFisheyeIsRefusedWhereItIsWrittenAndUsedWhereItIsRecorded) {
  const std::string key = "light_camera.intrinsics", k = "[-0.2, 0.0, 0.0, 0.0]";
  const std::string words =
      "k: the lens model folds back at 73.9 degrees off axis; allowed: a growing radius up to "
      "max_angle_deg";
  const std::string set = edited(set_text, key, "k", k).first;
  EXPECT_THAT(test::error_of([&] { set::parse_set(set, "stage.toml"); }), HasSubstr(words));
  nlohmann::json json = nlohmann::json::parse(frames_text);
  json["light"]["intrinsics"]["k"] = nlohmann::json::parse(k);
  EXPECT_THAT(test::error_of([&] { describe(json.dump()); }), HasSubstr(words));

  const std::string session = edited(session_text(), "light.calibration", "k", k).first;
  const auto light = session::parse_session_toml(session, "session.toml").info.light;
  ASSERT_TRUE(light);
  const double angle = 97.3 * (std::numbers::pi / 180);
  EXPECT_EQ(light->intrinsics.max_angle_rad, angle);
  EXPECT_NEAR(Fisheye(light->intrinsics).max_angle_rad(), std::sqrt(1 / 0.6), 1e-12);
}

// What earlier versions left out of session.toml.
TEST(Calibration, SessionsOfBeforeTheLensAndTheSensorWereMeasuredOpen) {
  auto text = edited(session_text(), "light.calibration", "vignetting", "").first;
  text = edited(text, "light.calibration", "dark_level", "").first;
  const auto light = session::parse_session_toml(text, "session.toml").info.light;
  ASSERT_TRUE(light);
  EXPECT_EQ(light->vignetting, Vignetting{});
  EXPECT_EQ(light->dark_level, glm::dvec3(0));
}

}  // namespace previz::import_calibration_test
