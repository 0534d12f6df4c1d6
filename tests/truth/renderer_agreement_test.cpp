// The GPU renderer against the independent CPU tracer, both radiances, at reduced size: on sets
// varied by seed (camera, objects diffuse, textured, plastic, rough and smooth metal, emitter,
// removed, lamps, lens) and on the ground truth sets.
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/scene/load.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/truth_set.hpp"
#include "tests/truth/two_tracers.hpp"

namespace previz::test::renderer_agreement_test {

class RandomSets : public ::testing::TestWithParam<std::uint32_t> {
 protected:
  static View view() {
    return random_scene(GetParam(), {.width = 64,
                                     .height = 48,
                                     .removed_objects = GetParam() % 2 == 1 ? 1 : 0,
                                     .lights = GetParam() % 2 == 0 ? 2 : 0,
                                     .lens = GetParam() % 3 == 0});
  }
};

TEST_P(RandomSets, AgreeWithTheCpuTracer) {
  expect_agreement(view(), 32, true);
}

// Six consecutive seeds put each material on the first virtual object.
INSTANTIATE_TEST_SUITE_P(Seeds, RandomSets, ::testing::Range(1u, 7u));

// One world as the only one there is.
View alone(View view, std::uint32_t world) {
  std::erase_if(view.scene.instances,
                [world](const auto& instance) { return (instance.presence & world) == 0; });
  for (scene::Instance& instance : view.scene.instances) instance.presence = scene::world_both;
  for (set::Light& light : view.scene.lights) {
    if (world == scene::world_mixed) light.emission *= light.tint;
    light.tint = glm::dvec3(1);
    light.gain_mixed = light.gain_real =
        world == scene::world_mixed ? light.gain_mixed : light.gain_real;
  }
  return view;
}

// Both worlds from one run of paths, against two renders that know nothing of each other. Lamps
// that are added, taken away and dimmed, and a removed object.
class SeparateRenders : public RandomSets {};
INSTANTIATE_TEST_SUITE_P(Seeds, SeparateRenders, ::testing::Values(2u, 5u));

TEST_P(SeparateRenders, ShowWhatOneRunShows) {
  const Worlds pair = gpu_scrambles(view(), 32, true, 1000);
  const Worlds mixed = gpu_scrambles(alone(view(), scene::world_mixed), 32, true, 2000);
  const Worlds real = gpu_scrambles(alone(view(), scene::world_real), 32, true, 3000);
  expect_agree(pair, {mixed.mixed, real.real});
}

// Lamps that are real, dimmed or added, each in a colour of its own when mixed.
class TintedSets : public RandomSets {
 protected:
  static View view() {
    return random_scene(GetParam(), {.width = 64, .height = 48, .lights = 3, .tinted = true});
  }
};
INSTANTIATE_TEST_SUITE_P(Seeds, TintedSets, ::testing::Values(21u, 22u, 23u));

TEST_P(TintedSets, AgreeWithTheCpuTracer) {
  expect_agreement(view(), 16, true);
}

TEST_P(TintedSets, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(view(), 16, true);
}

// A limb and a ball that change their shape, one in both worlds and one virtual, on a table.
View figures() {
  View view = empty_view({0.3, -2, 1.1}, {0, 0, 0.3}, pinhole(48, 32, 0.9));
  scene::Scene& scene = view.scene;
  add(scene, rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}));
  add_limb(scene, limb_mesh(24, 16, 5), 5, add_material(scene, diffuse({0.8f, 0.3f, 0.2f})),
           at({-0.4, 0.2, 0.05}), scene::world_mixed);
  add_squeezed_ball(scene, squeezed_ball_mesh(0.3, 32, 16),
                    add_material(scene, metal({0.3f, 0.5f, 0.7f}, 0.4f)), at({0.5, -0.1, 0.32}));
  view.environment = one_sided_sky();
  return view;
}

std::vector<scene::Shape> shapes_of(const View& view) {
  return {bent_limb(view.scene.deformations[0], 0.3), {{0.9}, {}}};
}

TEST(DeformedFigures, AgreeWithTheCpuTracer) {
  const View view = figures();
  expect_agreement(view, 16, true, shapes_of(view));
}

TEST(DeformedFigures, HaveTheSameDifferenceByBothEstimators) {
  const View view = figures();
  expect_same_difference(view, 16, true, shapes_of(view));
}

// The difference estimator against the paired one: by the difference where nothing covers the
// picture, and by the composite over black everywhere. Lamps differ between the worlds in every
// other set, objects are taken away in the rest.
TEST_P(RandomSets, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(view(), 16, true);
}

// Real radiance from a plate that is the renderer's own converged real world, against tracing it.
// The plate's pixels are box means between which the camera's radiance is interpolated, so matt
// real surfaces without textures are looked at.
class CameraSets : public RandomSets {};
INSTANTIATE_TEST_SUITE_P(Seeds, CameraSets, ::testing::Values(2u, 3u));  // lamps; a lens, a removed

TEST_P(CameraSets, HaveTheSameCompositeByTheCamera) {
  View view = RandomSets::view();
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  for (scene::Instance& instance : view.scene.instances)
    if ((instance.presence & scene::world_real) != 0) instance.material = 0;
  view.scene.materials[0] = diffuse(glm::vec3(0.5f, 0.4f, 0.3f));
  constexpr double white = 8;
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const Plate plate =
      linear_plate(k.width, k.height, SetRenderer(view).rendered(1024, 7).real, white);
  const auto scrambled = [&](set::RealRadiance radiance, std::uint32_t first_seed) {
    SetRenderer renderer(view, {.real_radiance = radiance});
    truth::Scrambles result = no_pictures(view);
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer.begin({std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera,
                      first_seed + i});
      renderer.render(16);
      expect_clean(renderer.counters());
      result.pictures.push_back(widen(renderer.layers().composite));
    }
    return result;
  };
  expect_agree(scrambled(set::RealRadiance::traced, 100),
               scrambled(set::RealRadiance::camera, 1001));
}

// The committed glass set, or one of the others.
std::filesystem::path truth_directory(const std::string& name) {
  if (name == "glass") return PREVIZ_SOURCE_DIR "/tests/truth/data/glass";
  return shared_data("groundtruth") / name;
}

View truth_view(const std::filesystem::path& directory) {
  const truth::TruthSet truth_set = truth::load_truth_set(directory);
  set::Set set = truth::set_of(truth_set);
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

TEST_P(TruthScenes, AgreeWithTheCpuTracer) {
  const auto directory = truth_directory(GetParam());
  PREVIZ_NEEDS(directory / "set.json");
  expect_agreement(truth_view(directory), 32, false);
}

TEST_P(TruthScenes, HaveTheSameDifferenceByBothEstimators) {
  const auto directory = truth_directory(GetParam());
  PREVIZ_NEEDS(directory / "set.json");
  expect_same_difference(truth_view(directory), 32, false);
}

INSTANTIATE_TEST_SUITE_P(Sets, TruthScenes, ::testing::Values("glass", "desk", "statues"),
                         [](const auto& set) { return set.param; });

}  // namespace previz::test::renderer_agreement_test
