// The light from frame to frame: what is switched, what is static, what cannot be used, and that
// nobody waits for it.
#include "daemon/core/pipeline/light_feed.hpp"
#include "daemon/core/pipeline/light_stage.hpp"
#include "drivers/bracket.hpp"
#include "drivers/plate.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::light_camera_test {

using test::degree;

constexpr int picture_size = 64;
constexpr std::int64_t frame_ns = 40'000'000;
const std::vector<double> bracket{1.0 / 256, 1.0 / 16, 1.0};

ObserverCalibration film_camera() {
  ObserverCalibration camera;
  camera.intrinsics = {40, 30, 30, 30, 19.5, 14.5, 0, 0, 0, 0, 0};
  return camera;
}

LightCameraCalibration light_camera() {
  LightCameraCalibration camera = test::fisheye_camera(picture_size);
  camera.world_from_camera = test::looking(0, 90);
  camera.world_from_camera[3] = glm::dvec4(0, 0, 0, 1);
  return camera;
}

set::Set plain_set() {
  set::Set set;
  set.file = "stage.toml";
  return set;
}

// What a noisy light camera sees of a lamp and of walls that it brightens.
class Studio {
 public:
  bool lit = true;

  FramePtr photograph(double exposure) {
    const Fisheye lens(light_camera().intrinsics);
    const lighting::SensorNoise noise;
    std::normal_distribution<double> normal;
    std::vector<glm::dvec3> signals;
    for (int y = 0; y < picture_size; ++y) {
      for (int x = 0; x < picture_size; ++x) {
        const auto ray = lens.unproject({x, y});
        const bool in_lamp = lit && ray && ray->z > std::cos(8 * degree);
        const double radiance = !ray ? 0 : in_lamp ? lamp : lit ? 1.1 * wall : wall;
        glm::dvec3 signal(0);
        for (int c = 0; c < 3; ++c)
          signal[c] = exposure * radiance +
                      normal(random_) * std::sqrt(exposure * radiance * noise.signal_per_electron +
                                                  noise.read_noise * noise.read_noise);
        signals.push_back(signal);
      }
    }
    Frame frame = *test::make_frame(picture_size, picture_size, exposure, signals);
    frame.sequence = taken_;
    frame.timestamp_ns = static_cast<std::int64_t>(taken_++) * frame_ns;
    return std::make_shared<Frame>(std::move(frame));
  }

 private:
  static constexpr double wall = 0.3, lamp = 200;
  std::mt19937 random_{11};
  std::uint64_t taken_ = 0;
};

double flux_of(const LightPtr& light) {
  return lighting::total_flux(light->lighting.environment).g;
}

TEST(LightStage, ASwitchedOffLightIsGoneWithinOneFrameInAnyPhaseOfTheBracket) {
  for (std::size_t phase = 0; phase < bracket.size(); ++phase) {
    Studio studio;
    LightStage stage(plain_set(), light_camera(), film_camera());
    std::size_t i = 0;
    const auto see = [&] {
      stage.see(studio.photograph(bracket[i % bracket.size()]), i);
      ++i;
      return flux_of(stage.light());
    };
    double lit = 0;
    while (i < 12 + phase) lit = see();
    studio.lit = false;
    const double first = see();
    for (std::size_t more = 1; more < bracket.size(); ++more) see();
    const double dark = see();
    // What is left until the bracket has gone round: where the newest exposure is too short to deny
    // it, the white of the longest, 1 of 200 (0.5 %); and on the walls, seen and continued into the
    // unseen part, older exposures that differ by the tenth that the lamp gave them, less than
    // exposures may be wrong by: 0.03 of 4 pi sr, of what 200 of 0.061 sr and that make (3.0 %).
    EXPECT_LT((first - dark) / (lit - dark), 0.035) << phase;
    EXPECT_GT(lit, 4 * dark);
  }
}

bool says_blinded(const LightPtr& light) {
  return testing::Value(light->lighting.report.notes, Contains(HasSubstr("blinded")));
}

// A bracket that begins with an exposure so long that it clips the whole picture: by itself that
// frame says that the light camera is blinded.
TEST(LightStage, TheFirstLightIsAWholeBracketsWhereOneIsAwaited) {
  std::vector<double> exposures{100};
  exposures.insert(exposures.end(), bracket.begin(), bracket.end());
  Studio studio;
  LightStage at_once(plain_set(), light_camera(), film_camera());
  LightStage unasked(plain_set(), light_camera(), film_camera());
  LightStage stage(plain_set(), light_camera(), film_camera());
  stage.await_bracket(exposures.size());
  for (std::size_t i = 0; i < exposures.size(); ++i) {
    EXPECT_EQ(stage.light(), nullptr) << i;
    const FramePtr frame = studio.photograph(exposures[i]);
    for (LightStage* each : {&at_once, &unasked, &stage}) each->see(frame, i);
    if (i == 0) {
      EXPECT_TRUE(says_blinded(at_once.light()));
    }
  }
  const LightPtr first = stage.light();
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->sequences.size(), exposures.size());
  EXPECT_FALSE(says_blinded(first));
  // Waiting changes nothing in the light, and later light waits for nothing.
  EXPECT_EQ(first->lighting.environment.radiance, unasked.light()->lighting.environment.radiance);
  stage.see(studio.photograph(exposures[0]), exposures.size());
  EXPECT_NE(stage.light(), first);
}

TEST(LightStage, ABracketThatLacksAnExposureIsNotAwaitedForEver) {
  Studio studio;
  LightStage stage(plain_set(), light_camera(), film_camera());
  stage.await_bracket(3);
  for (std::size_t i = 0; i < 5; ++i) {
    stage.see(studio.photograph(bracket[i % 2]), i);
    EXPECT_EQ(stage.light(), nullptr) << i;
  }
  stage.see(studio.photograph(bracket[1]), 5);
  EXPECT_NE(stage.light(), nullptr);
}

// A set that states the exposure has no other to wait for, and a frame that it names comes once.
TEST(LightStage, WhatHasNoBracketIsNotAwaited) {
  Studio studio;
  set::Set stated = plain_set();
  stated.light_camera.exposure = 0.5;
  LightStage by_exposure(stated, light_camera(), film_camera());
  by_exposure.await_bracket(3);
  by_exposure.see(studio.photograph(1), 0);
  EXPECT_NE(by_exposure.light(), nullptr);

  set::Set named = plain_set();
  named.lighting.frame = 0;
  LightStage by_frame(named, light_camera(), film_camera());
  by_frame.await_bracket(3);
  by_frame.see(studio.photograph(1), 0);
  EXPECT_NE(by_frame.light(), nullptr);
}

TEST(LightStage, AStaticScenesFluxStandsStill) {
  for (const double smoothing_s : {0.0, 0.25}) {
    Studio studio;
    set::Set set = plain_set();
    set.lighting.smoothing_s = smoothing_s;
    LightStage stage(set, light_camera(), film_camera());
    double sum = 0, squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < 60; ++i) {
      stage.see(studio.photograph(bracket[i % bracket.size()]), i);
      if (i < bracket.size()) continue;
      const double flux = flux_of(stage.light());
      sum += flux;
      squares += flux * flux;
      ++count;
    }
    const double mean = sum / count;
    const double deviation = std::sqrt(std::max(0.0, squares / count - mean * mean)) / mean;
    RecordProperty("deviation_" + std::to_string(smoothing_s), std::to_string(deviation));
    EXPECT_LT(deviation, 0.005) << smoothing_s;
  }
}

TEST(LightStage, FramesThatCannotBeUsedAreLeftOutAndToldAndTheLightStays) {
  Studio studio;
  LightStage stage(plain_set(), light_camera(), film_camera());
  EXPECT_EQ(stage.light(), nullptr);
  Frame small = *test::make_frame(8, 8, 1, std::vector<glm::dvec3>(64));
  small.sequence = 77;
  const FramePtr wrong = std::make_shared<Frame>(small);
  stage.see(wrong, 0);
  EXPECT_EQ(stage.light(), nullptr);
  auto troubles = stage.troubles();
  ASSERT_EQ(troubles.size(), 1u);
  EXPECT_EQ(troubles[0], "light frame 77 is skipped: it has 8x8 pixels, the calibration 64x64");
  EXPECT_TRUE(stage.troubles().empty());

  stage.see(studio.photograph(1), 1);
  const LightPtr light = stage.light();
  ASSERT_NE(light, nullptr);
  Frame unexposed = *studio.photograph(1);
  for (const double exposure : std::vector<double>{0.0, -1.0, std::nan(""), HUGE_VAL}) {
    unexposed.exposure = exposure;
    stage.see(std::make_shared<Frame>(unexposed), 2);
  }
  stage.see(wrong, 3);
  EXPECT_EQ(stage.troubles().size(), 5u);
  EXPECT_EQ(stage.light(), light);
}

TEST(LightStage, AWanderingExposureKeepsTheNewestOnly) {
  Studio studio;
  LightStage stage(plain_set(), light_camera(), film_camera());
  for (std::size_t i = 0; i < most_exposures + 3; ++i)
    stage.see(studio.photograph(std::pow(1.05, static_cast<double>(i))), i);
  const LightPtr light = stage.light();
  EXPECT_EQ(light->sequences.size(), most_exposures);
  EXPECT_EQ(light->sequences.front(), 3u);
  EXPECT_EQ(stage.troubles().size(), 3u);
}

TEST(LightStage, FillsFromTheFilmCamera) {
  Studio studio;
  set::Set set = plain_set();
  set.lighting.unseen = set::UnseenRule::observer;
  LightStage stage(set, light_camera(), film_camera());
  EXPECT_TRUE(stage.needs_observer());
  EXPECT_TRUE(stage.remembers());
  Frame view;
  view.width = 40;
  view.height = 30;
  view.exposure = 2;
  view.bytes.assign(frame_bytes(view.format, 40, 30), 188);  // sRGB: a signal of 0.503
  stage.see_observer(to_plate(view), view.exposure, test::looking(0, -60));
  EXPECT_EQ(stage.light(), nullptr);  // the film camera alone is no light
  stage.see(studio.photograph(1), 0);
  const lighting::EnvironmentMap& map = stage.light()->lighting.environment;
  const auto below = lighting::texel_index(map.size, glm::vec3(test::towards(0, -60)));
  EXPECT_NEAR(map.radiance[below].g, 0.503 / 2, 0.001);
}

TEST(LightStage, TheRoomIsABoxOrAFileAndHoldsTheCamera) {
  const test::TemporaryDirectory folder;
  test::GltfWriter gltf;  // a wall at x = 2, facing -x; glTF's Y is the world's Z
  const int positions = gltf.positions({{2, -9, -9}, {2, -9, 9}, {2, 9, 9}, {2, 9, -9}});
  const int indices = gltf.indices({0, 1, 2, 0, 2, 3});
  gltf.root("wall", gltf.mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}}));
  gltf.save(folder / "wall.gltf");
  set::Set set = plain_set();
  set.lighting.room = set::Room{};
  set.lighting.room->file = folder / "wall.gltf";
  EXPECT_NO_THROW(LightStage(set, light_camera(), film_camera()));

  set.lighting.room = set::Room{.size_m = glm::dvec3(2), .file = {}, .file_as_written = {}};
  EXPECT_NO_THROW(LightStage(set, light_camera(), film_camera()));
  set.lighting.room->seen_from = {0, 0, 1.5};
  EXPECT_THROW(LightStage(set, light_camera(), film_camera()), Error);
  set.lighting.room->seen_from = {0, 0, 0};
  LightCameraCalibration outside = light_camera();
  outside.world_from_camera[3] = glm::dvec4(3, 0, 0, 1);
  EXPECT_THROW(LightStage(set, outside, film_camera()), Error);
}

// A light camera of so many frames.
auto light_frames(std::uint64_t count) {
  return [next = std::uint64_t{0}, count]() mutable -> std::optional<LightFrame> {
    if (next == count) return std::nullopt;
    return LightFrame{std::make_shared<Frame>(), next++};
  };
}

// A light stage that takes a second a frame, or for ever: here until every frame was rendered. Were
// a frame to wait for it, both would wait, and the estimate gives up after a minute.
TEST(LightFeed, NoFrameWaitsForTheLight) {
  constexpr int frames = 200;
  Metrics metrics;
  LightFeed feed;
  BoundedQueue<int> seen(1), rendered(1);
  std::promise<void> all_rendered;
  std::atomic<int> shown = 0, lit = 0;
  std::atomic<bool> waited_in_vain = false;
  {
    StageThreads stages(metrics, {});
    feed.start(stages, light_frames(100),
               [&, gate = all_rendered.get_future().share()](const std::vector<LightFrame>& waiting,
                                                             const std::optional<ObserverView>&) {
                 EXPECT_FALSE(waiting.empty());
                 if (gate.wait_for(std::chrono::minutes(1)) != std::future_status::ready)
                   waited_in_vain = true;
                 return std::make_shared<const Light>();
               });
    stages.source("observer", seen, [next = 0]() mutable -> std::optional<int> {
      if (next == frames) return std::nullopt;
      return next++;
    });
    stages.stage("render", seen, rendered, [&](int frame) {
      feed.see_observer({});
      if (feed.newest()) ++lit;
      return frame;
    });
    stages.sink("display", rendered, [&](int) {
      if (++shown == frames) all_rendered.set_value();
    });
    stages.wait();
    EXPECT_NE(feed.newest(), nullptr);
  }
  EXPECT_FALSE(waited_in_vain);
  EXPECT_EQ(shown, frames);
  EXPECT_EQ(lit, 0);  // every frame was rendered before the first estimate ended
}

TEST(LightFeed, TheEstimateTakesAllThatWaits) {
  Metrics metrics;
  LightFeed feed;
  std::vector<std::uint64_t> taken;
  StageThreads stages(metrics, {});
  feed.start(stages, light_frames(500),
             [&](const std::vector<LightFrame>& waiting, const std::optional<ObserverView>&) {
               for (const LightFrame& frame : waiting) taken.push_back(frame.index);
               return std::make_shared<const Light>();
             });
  stages.wait();
  std::vector<std::uint64_t> all(500);
  std::iota(all.begin(), all.end(), std::uint64_t{0});
  EXPECT_EQ(taken, all);  // none lost, in order
}

// The light camera's frames are recorded as they are taken, so that nothing may hold up their
// thread: here an estimate that ends only when the camera has ended. What waits meanwhile is
// bounded by its bytes, and what is left out is counted.
TEST(LightFeed, ASlowEstimateHoldsUpNoLightFrame) {
  constexpr std::uint64_t frames = 400;
  Metrics metrics;
  LightFeed feed;
  std::promise<void> begun, all_taken;
  std::atomic<bool> waited_in_vain = false;
  std::uint64_t estimates = 0, estimated = 0, last = 0;
  {
    Frame large;
    large.bytes.resize(1'000'000);
    const auto frame = std::make_shared<const Frame>(std::move(large));
    StageThreads stages(metrics, {});
    feed.start(
        stages,
        [&, next = std::uint64_t{0}]() mutable -> std::optional<LightFrame> {
          if (next == 1) begun.get_future().wait();
          if (next < frames) return LightFrame{frame, next++};
          all_taken.set_value();
          return std::nullopt;
        },
        [&, gate = all_taken.get_future().share()](const std::vector<LightFrame>& waiting,
                                                   const std::optional<ObserverView>&) {
          if (++estimates == 1) begun.set_value();
          if (gate.wait_for(std::chrono::minutes(1)) != std::future_status::ready)
            waited_in_vain = true;
          estimated += waiting.size();
          last = waiting.back().index;
          return std::make_shared<const Light>();
        });
    stages.wait();
  }
  EXPECT_FALSE(waited_in_vain);
  EXPECT_EQ(metrics.snapshot(1).stages.at("light camera").frames, frames);
  // The first frame, and 256 MB of those after it.
  EXPECT_EQ(estimated, 1 + 256u);
  EXPECT_EQ(metrics.snapshot(1).stages.at("lighting").dropped.at("newer frame"),
            frames - estimated);
  EXPECT_EQ(last, frames - 1);
}

}  // namespace previz::pipeline::light_camera_test
