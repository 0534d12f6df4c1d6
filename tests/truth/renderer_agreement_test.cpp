// The GPU renderer against the independent CPU tracer, both radiances, at reduced size: on sets
// varied by seed (camera, objects diffuse, textured, plastic, rough and smooth metal, emitter,
// removed, lamps, lens) and on the ground truth sets.
#include <cstdlib>
#include <filesystem>
#include <string>

#include "daemon/lighting/lighting.hpp"
#include "tests/truth/agreement.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/cpu_tracer.hpp"
#include "tests/truth/truth_set.hpp"
#include "tests/unit/render_fixture.hpp"

namespace previz::testing {
namespace {

constexpr int scrambles = 16;

struct Worlds {
  truth::Scrambles mixed, real;
};

std::vector<glm::dvec3> widen(const std::vector<glm::vec3>& layer) {
  return {layer.begin(), layer.end()};
}

Worlds gpu_scrambles(const View& view, int samples, bool caustics) {
  Worlds worlds;
  set::Estimation estimation;
  estimation.caustics = caustics ? set::Caustics::traced : set::Caustics::none;
  render::Renderer renderer(shared_device(), estimation, view.calibration);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, set::LightSampling::importance);
  for (std::uint32_t i = 0; i < scrambles; ++i) {
    render::FrameInput frame;
    frame.world_from_camera = view.world_from_camera;
    frame.seed = 1000 + i;
    renderer.begin(frame);
    renderer.render(samples);
    expect_clean(renderer.counters());
    const render::Layers layers = renderer.layers();
    worlds.mixed.pictures.push_back(widen(layers.mixed));
    worlds.real.pictures.push_back(widen(layers.real));
  }
  return worlds;
}

// The CPU tracer traces each world alone, with seeds of its own.
Worlds cpu_scrambles(const View& view, int samples, bool caustics) {
  Worlds worlds;
  truth::TraceOptions options;
  options.caustics = caustics;
  truth::CpuTracer tracer(view.scene, view.environment, options);
  for (int i = 0; i < scrambles; ++i) {
    const auto seed = static_cast<std::uint64_t>(2 * i + 1);
    worlds.mixed.pictures.push_back(
        tracer.trace(view.calibration, view.world_from_camera, scene::world_mixed, samples, seed)
            .mean);
    worlds.real.pictures.push_back(
        tracer.trace(view.calibration, view.world_from_camera, scene::world_real, samples, seed + 1)
            .mean);
  }
  return worlds;
}

// Without caustics where mirrors or glass meet small lamps: so rare and bright are the paths that
// sixteen scrambles do not know their own spread.
void expect_agreement(const View& view, int samples, bool caustics) {
  Worlds gpu = gpu_scrambles(view, samples, caustics);
  Worlds cpu = cpu_scrambles(view, samples, caustics);
  for (auto* s : {&gpu.mixed, &gpu.real, &cpu.mixed, &cpu.real}) {
    s->width = view.calibration.intrinsics.width;
    s->height = view.calibration.intrinsics.height;
  }
  const truth::Agreement mixed = truth::agreement(gpu.mixed, cpu.mixed);
  EXPECT_TRUE(mixed.agree) << "mixed: " << mixed.report();
  const truth::Agreement real = truth::agreement(gpu.real, cpu.real);
  EXPECT_TRUE(real.agree) << "real: " << real.report();
}

class RandomSets : public ::testing::TestWithParam<std::uint32_t> {
 protected:
  static View view() {
    RandomScene options;
    options.width = 64;
    options.height = 48;
    options.lights = GetParam() % 2 == 0 ? 2 : 0;
    options.lens = GetParam() % 3 == 0;
    options.removed_objects = GetParam() % 2 == 1 ? 1 : 0;
    return random_scene(GetParam(), options);
  }
};

TEST_P(RandomSets, agree_with_the_cpu_tracer) {
  expect_agreement(view(), 32, true);
}

// Six consecutive seeds put each material on the first virtual object.
INSTANTIATE_TEST_SUITE_P(Seeds, RandomSets, ::testing::Range(1u, 7u));

// The difference estimator against the paired one: by the difference where nothing covers the
// picture, and by the composite over black everywhere. Lamps differ between the worlds in every
// other set, objects are taken away in the rest.
TEST_P(RandomSets, have_the_same_difference_by_both_estimators) {
  const View view = RandomSets::view();
  const auto scrambled = [&](set::Estimator estimator, std::uint32_t first_seed) {
    set::Estimation estimation;
    estimation.estimator = estimator;
    render::Renderer renderer(shared_device(), estimation, view.calibration);
    renderer.set_scene(view.scene);
    renderer.set_environment(view.environment, set::LightSampling::importance);
    truth::Scrambles result;
    result.width = view.calibration.intrinsics.width;
    result.height = view.calibration.intrinsics.height;
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer.begin({{}, 1.0, view.world_from_camera, first_seed + i});
      renderer.render(16);
      expect_clean(renderer.counters());
      result.pictures.push_back(widen(renderer.layers().composite));
    }
    return result;
  };
  const truth::Agreement agreement = truth::agreement(scrambled(set::Estimator::paired, 1),
                                                      scrambled(set::Estimator::difference, 1001));
  EXPECT_TRUE(agreement.agree) << agreement.report();
}

// The committed glass set, or one of the others beside the project (PREVIZ_SHARED names the
// folder).
std::filesystem::path truth_directory(const std::string& name) {
  const std::filesystem::path source = PREVIZ_SOURCE_DIR;
  if (name == "glass") return source / "tests/truth/data/glass";
  const char* shared = std::getenv("PREVIZ_SHARED");
  return (shared ? std::filesystem::path(shared) : source / "../shared") / "groundtruth" / name;
}

View truth_view(const std::filesystem::path& directory) {
  const truth::TruthSet truth_set = truth::load_truth_set(directory);
  set::Set set;
  set.objects.resize(2);
  set.objects[0].name = "phantom";
  set.objects[0].file = truth_set.phantom;
  set.objects[0].presence = set::Presence::phantom;
  set.objects[1].name = "virtual";
  set.objects[1].file = truth_set.virtual_objects;
  set.lighting.environment = truth_set.environment;
  set.lighting.resolution = 256;
  View view;
  view.scene = scene::load_scene(set);
  view.environment = lighting::load_environment(set.lighting).environment;
  view.calibration = truth::resized(truth_set.observer, 0.1);
  view.world_from_camera =
      observer_frame(truth_set, truth_set.truth_frames.front()).world_from_camera;
  return view;
}

class TruthScenes : public ::testing::TestWithParam<std::string> {};

TEST_P(TruthScenes, agree_with_the_cpu_tracer) {
  const auto directory = truth_directory(GetParam());
  if (!std::filesystem::exists(directory / "set.json"))
    GTEST_SKIP() << "no ground truth set at " << directory;
  expect_agreement(truth_view(directory), 32, false);
}

INSTANTIATE_TEST_SUITE_P(Sets, TruthScenes, ::testing::Values("glass", "desk", "statues"),
                         [](const auto& set) { return set.param; });

}  // namespace
}  // namespace previz::testing
