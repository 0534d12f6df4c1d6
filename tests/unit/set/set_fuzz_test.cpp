// Thousands of damaged set files: each is either a set or a list of problems that all name the
// file.
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/pose.hpp"
#include "daemon/core/set/set.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/support/test.hpp"

namespace previz::set::set_fuzz_test {

const std::string file = "folder/stage.toml";

// Uses every table and every kind of value.
const std::string whole = R"(
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

// Half of them are damaged in what they say, the others in how it is written.
std::string damaged(std::mt19937& random) {
  if (random() % 2 == 0) return fuzz::mutate_bytes(whole, random);
  return fuzz::mutate_toml(fuzz::bytes_of(whole), random).value();
}

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
  std::mt19937 random(1);
  int accepted = 0;
  for (int round = 0; round < rounds && !HasFailure(); ++round) {
    const std::string text = damaged(random);
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
  const std::string text = "a = " + std::string(300, '[');
  EXPECT_THROW(parse_set(text, file), Error);
}

}  // namespace previz::set::set_fuzz_test
