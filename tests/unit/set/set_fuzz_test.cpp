// Thousands of damaged set files: each is either a set or a list of problems that all name the
// file.
#include "daemon/set/load.hpp"
#include "daemon/set/pose.hpp"
#include "daemon/set/set.hpp"
#include "drivers/error.hpp"
#include "tests/support/test.hpp"

namespace previz::set::set_fuzz_test {

const std::string file = "folder/stage.toml";

// Uses every table and every kind of value.
constexpr auto whole = R"(
[set]
name = "fuzz"
[observer]
driver = "replay"
device = "take"
exposure = 0.85
[observer.intrinsics]
width = 640
height = 480
fx = 612.0
fy = 612.0
cx = 319.5
cy = 239.5
[observer.lens]
focal_length_mm = 35.0
f_number = 2.8
focus_distance_m = 1.2
[observer.response]
kind = "table"
table = [0.0, 0.2, 1.0]
[light_camera.intrinsics]
width = 512
height = 512
fx = 145.5
fy = 145.5
cx = 255.5
cy = 255.5
k = [0.01, 0.0, -0.001, 0.0]
max_angle_deg = 100.0
[light_camera.pose]
world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]]
[tracking]
enabled = true
decimate = 2.0
[[tag]]
id = 0
size_m = 0.08
position_m = [0.0, 0.0, 0.0]
rotation_deg = [0.0, 0.0, 20.0]
[[tag]]
id = 1
corners_m = [[1, 0, 0], [1.1, 0, 0], [1.1, 0.1, 0], [1, 0.1, 0]]
[[light]]
type = "rectangle"
position_m = [0.0, 0.0, 2.0]
direction = [0.0, 0.0, -1.0]
width_m = 0.5
height_m = 0.25
emission = [1.0, 1.0, 1.0]
[lighting]
unseen = "constant"
unseen_radiance = [0.1, 0.1, 0.1]
[estimator]
seed = 7
[quality]
samples = 16
[output]
exr = true
)";

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const auto& line : lines) text += line + '\n';
  return text;
}

class Mutator {
 public:
  explicit Mutator(std::uint32_t seed) : random_(seed) {}

  std::string operator()(std::string text) {
    for (std::size_t i = 0, count = 1 + below(3); i < count; ++i)
      text = below(2) ? of_bytes(std::move(text)) : of_lines(std::move(text));
    return text;
  }

 private:
  std::size_t below(std::size_t bound) { return random_() % bound; }

  const std::string& token() {
    static const std::vector<std::string> tokens = {"nan",     "-inf",
                                                    "1e999",   "-1",
                                                    "0",       "9223372036854775807",
                                                    "1e-320",  "\"\"",
                                                    "'''",     "[[",
                                                    "]]",      "{",
                                                    "}",       "=",
                                                    "#",       ".",
                                                    ",",       "\n",
                                                    "\r",      "[]",
                                                    "\xc3",    "\xf0\x9f\x8e\xac",
                                                    "true",    "[0, 0, 0]",
                                                    "0x7f",    "100",
                                                    "2.5",     "0.1",
                                                    "[",       "\"\\n\" = 1\n",
                                                    "\\u0000", std::string(1, '\0')};
    return tokens[below(tokens.size())];
  }

  std::string of_bytes(std::string text) {
    if (text.empty()) return text;
    const auto at = below(text.size());
    switch (below(8)) {
      case 0:
        text.resize(at);
        break;
      case 1:
        text.erase(at, 1 + below(8));
        break;
      case 2:
        text.insert(at, token());
        break;
      default:
        text[at] = static_cast<char>(below(256));
    }
    return text;
  }

  std::string of_lines(std::string text) {
    auto lines = lines_of(text);
    if (lines.empty()) return text;
    auto& line = lines[below(lines.size())];
    const auto other = lines[below(lines.size())];
    switch (below(6)) {
      case 0:
        line.clear();
        break;
      case 1:
        line = other;
        break;
      case 2:
        line += '\n' + other;
        break;
      default:
        if (const auto equals = line.find('='); equals != std::string::npos)
          line.replace(equals + 1, std::string::npos, token());
    }
    return joined(lines);
  }

  std::mt19937 random_;
};

// What a set that was accepted promises to the rooms above.
void expect_sound(const Set& set, const std::string& text) {
  bool sound = set.quality.samples >= 1 && set.estimation.max_depth >= 1;
  for (const auto& tag : set.tracking.tags)
    sound = sound && tag.size_m > 0 && rigidity_error(tag.world_from_tag) < 1e-12;
  if (const auto& observer = set.observer.calibration) {
    sound = sound && observer->intrinsics.fx > 0 && observer->intrinsics.width > 0;
    if (const auto& lens = observer->lens)
      sound = sound && lens->f_number > 0 && lens->focus_distance_m > lens->focal_length_m;
  }
  for (const auto& light : set.lights)
    sound = sound && std::abs(glm::length(light.direction) - 1) < 1e-12;
  EXPECT_TRUE(sound) << text;
}

TEST(SetFuzz, DamagedFilesAreSetsOrProblemsThatNameTheFile) {
  ASSERT_NO_THROW(parse_set(whole, file));
  constexpr int rounds = 3000;
  Mutator mutate(1);
  int accepted = 0;
  for (int round = 0; round < rounds && !HasFailure(); ++round) {
    const auto text = mutate(whole);
    try {
      expect_sound(parse_set(text, file), text);
      ++accepted;
    } catch (const Error& error) {
      const auto problems = lines_of(error.what());
      EXPECT_FALSE(problems.empty()) << text;
      for (const auto& problem : problems)
        EXPECT_TRUE(problem.starts_with(file + ':')) << problem << "\nin\n" << text;
    }
  }
  // The mutations are neither harmless nor hopeless: both ways out were walked.
  EXPECT_GT(accepted, rounds / 100);
  EXPECT_LT(accepted, rounds / 2);
}

TEST(SetFuzz, DeepNestingIsAProblem) {
  const std::string text = "a = " + std::string(100000, '[');
  EXPECT_THROW(parse_set(text, file), Error);
}

}  // namespace previz::set::set_fuzz_test
