// config/reference.toml and the example: generated, complete, and true.
#include "daemon/core/set/reference.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/set/table.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::set::reference_test {

const std::filesystem::path config = std::filesystem::path(PREVIZ_SOURCE_DIR) / "config";

using session::content_of;

TEST(SetReference, IsTheCommittedFile) {
  EXPECT_EQ(content_of(config / "reference.toml"), reference_toml())
      << "config/reference.toml is stale: write it again with `ninja reference`";
}

// Prints every key's value in the set, in the file's form: equal prints are equal sets.
std::string printed(Draft& draft) {
  std::string all;
  for (const auto& section : sections(draft))
    if (section.kind == Section::Kind::always)
      for (const auto& key : section.open().keys) all += key.name + " = " + key.initial + '\n';
  return all;
}

TEST(SetReference, ParsesToTheDefaults) {
  Draft parsed, defaults;
  parsed.set = parse_set(reference_toml(), "config/reference.toml");
  EXPECT_EQ(parsed.set.name, "reference");
  EXPECT_EQ(parsed.set.output.directory, "config/out");
  EXPECT_EQ(parsed.set.recording.directory, "config/takes");
  parsed.set.output.directory = defaults.set.output.directory;
  parsed.set.recording.directory = defaults.set.recording.directory;
  EXPECT_EQ(printed(parsed), printed(defaults));
  EXPECT_FALSE(parsed.set.observer.calibration);
  EXPECT_FALSE(parsed.set.light_camera.calibration);
  EXPECT_FALSE(parsed.set.observer.exposure);
  EXPECT_FALSE(parsed.set.lighting.environment);
  EXPECT_TRUE(parsed.set.tracking.tags.empty());
  EXPECT_TRUE(parsed.set.objects.empty());
  EXPECT_TRUE(parsed.set.lights.empty());
}

// A left-out table means what its commented defaults say.
TEST(SetReference, CommentedDefaultsAreTheStructs) {
  Draft draft;
  for (const auto& section : sections(draft))
    for (const auto& key : section.open().keys)
      EXPECT_EQ(key.need.kind == Need::Kind::defaulted, !key.initial.empty())
          << section.path << '.' << key.name;
}

// Returns the forms in which a key may have this number: alone, in lists, in a matrix, in corners.
std::vector<Value> forms_of(double number) {
  const auto list = [](std::size_t count, const Value& entry) {
    return Value{{}, std::vector<Value>(count, entry)};
  };
  const Value alone{{}, number};
  std::vector<Value> forms = {alone, list(4, list(3, alone))};
  for (const std::size_t count : {1, 2, 3, 4, 5, 9, 45}) forms.push_back(list(count, alone));
  const std::array<double, 16> pose = {1, 0, 0, number, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  Value matrix{{}, std::vector<Value>()};
  for (std::size_t row = 0; row < 4; ++row) {
    Value& numbers = std::get<std::vector<Value>>(matrix.data).emplace_back();
    numbers.data = std::vector<Value>();
    for (std::size_t column = 0; column < 4; ++column)
      std::get<std::vector<Value>>(numbers.data).push_back({{}, pose[4 * row + column]});
  }
  forms.push_back(matrix);
  return forms;
}

bool takes(const set::Key& key, const Value& value) {
  try {
    key.read(value);
    return true;
  } catch (const Misread&) {
    return false;
  }
}

// No key takes a number that overflows a float, squared or not, or one that is not 0 and could be.
TEST(SetReference, NoKeyTakesANumberThatNobodyCanMean) {
  Draft draft;
  for (const auto& section : sections(draft))
    for (const auto& key : section.open().keys) {
      const auto zeros = forms_of(0), small = forms_of(1e-308);
      for (const double large : {1e308, -1e308, 1e13, -1e13})
        for (const Value& value : forms_of(large))
          EXPECT_FALSE(takes(key, value)) << section.path << '.' << key.name << ' ' << large;
      for (std::size_t i = 0; i < small.size(); ++i)
        EXPECT_LE(takes(key, small[i]), takes(key, zeros[i])) << section.path << '.' << key.name;
    }
}

// Take the "#" from every key: each value must be one that its key takes. What contradicts another
// form, or names a file that is not here, is another matter.
TEST(SetReference, ExamplesAreOfTheRightKind) {
  std::istringstream lines(reference_toml());
  std::string text;
  for (std::string line; std::getline(lines, line); text += line + '\n')
    if (line.size() > 1 && line[0] == '#' && line[1] != ' ') line.erase(0, 1);
  const std::string problems = test::error_of([&] { parse_set(text, "reference.toml"); });
  EXPECT_NE(problems, "") << "contradicting forms were taken";
  for (const char* words : {"is not allowed", "unknown", "not valid TOML"})
    EXPECT_THAT(problems, Not(HasSubstr(words)));
}

const auto example_file = config / "set.example.toml";

// The example's files are the crew's own; any file stands in for them here.
Set example(const std::string& text) {
  const auto& any = example_file;
  return parse_set(
      text, any, {{"stage/set.gltf", any}, {"stage/creature.gltf", any}, {"stage/lamp.gltf", any}});
}

TEST(SetExample, Parses) {
  const Set set = example(content_of(example_file));
  EXPECT_EQ(set.tracking.tags.size(), 3u);
  EXPECT_EQ(set.objects.size(), 3u);
  ASSERT_EQ(set.lights.size(), 3u);
  EXPECT_TRUE(set.lights[0].captured && set.lights[0].measured) << "the real lamp";
  EXPECT_FALSE(set.lights[1].captured || set.lights[2].captured) << "the added ones";
  ASSERT_EQ(set.captured_lamps.size(), 1u);
  EXPECT_EQ(set.captured_lamps[0].gain_mixed, 0.33);
  ASSERT_TRUE(set.observer.calibration && set.observer.calibration->lens);
  EXPECT_TRUE(set.light_camera.calibration);
}

// A crew that copies it has cameras, a screen, buttons, and a picture that keeps up with them.
TEST(SetExample, IsALiveSet) {
  const Set set = example(content_of(example_file));
  EXPECT_NE(set.observer.driver, replay_driver);
  EXPECT_NE(set.light_camera.driver, replay_driver);
  EXPECT_GT(set.light_camera.camera.bracket_s.size(), 1u);
  EXPECT_EQ(set.display.driver, "kms");
  EXPECT_GT(set.quality.fps, 0);
  EXPECT_FALSE(set.buttons.empty());
  for (const Button& button : set.buttons)
    EXPECT_TRUE(button.name.starts_with("gpio:") || button.name.starts_with("hid:")) << button.name;
}

// Its commented alternative: a recorded take in the cameras' place.
TEST(SetExample, CanReplayATake) {
  std::string text = content_of(example_file);
  ASSERT_THAT(text, HasSubstr("# driver = \"replay\"\n# device = \"takes/12A_take003\"\n"));
  const auto replayed = [&](const char* first, const char* behind) {
    const std::size_t begin = text.find(first), end = text.find(behind);
    ASSERT_LT(begin, end);
    ASSERT_NE(end, std::string::npos);
    text.replace(begin, end - begin, "driver = \"replay\"\ndevice = \"takes/12A_take003\"\n\n");
  };
  replayed("driver = \"v4l2\"", "# To rehearse");
  replayed("driver = \"aravis\"", "[light_camera.intrinsics]");
  const Set set = example(text);
  EXPECT_EQ(set.observer.driver, replay_driver);
  EXPECT_EQ(set.light_camera.driver, replay_driver);
}

// `previzd run` on it keeps up with the take on any machine.
TEST(SetDemo, HoldsARate) {
  EXPECT_GT(load_set(config / "demo/demo.toml").quality.fps, 0);
}

}  // namespace previz::set::reference_test
