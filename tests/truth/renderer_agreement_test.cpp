// The GPU renderer against the independent CPU tracer, both radiances, on sets varied by seed:
// camera, objects (diffuse, textured, plastic, rough and smooth metal, emitter), lamps, lens.
#include <string>

#include "tests/truth/agreement.hpp"
#include "tests/truth/cpu_tracer.hpp"
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

Worlds gpu_scrambles(const View& view, int samples) {
  Worlds worlds;
  render::Renderer renderer(shared_device(), {}, view.calibration);
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
Worlds cpu_scrambles(const View& view, int samples) {
  Worlds worlds;
  truth::CpuTracer tracer(view.scene, view.environment);
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

void expect_agreement(const View& view, int gpu_samples, int cpu_samples) {
  Worlds gpu = gpu_scrambles(view, gpu_samples);
  Worlds cpu = cpu_scrambles(view, cpu_samples);
  for (auto* s : {&gpu.mixed, &gpu.real, &cpu.mixed, &cpu.real}) {
    s->width = view.calibration.intrinsics.width;
    s->height = view.calibration.intrinsics.height;
  }
  const truth::Agreement mixed = truth::agreement(gpu.mixed, cpu.mixed);
  EXPECT_TRUE(mixed.agree) << "mixed: " << mixed.report();
  const truth::Agreement real = truth::agreement(gpu.real, cpu.real);
  EXPECT_TRUE(real.agree) << "real: " << real.report();
}

class RandomSets : public ::testing::TestWithParam<std::uint32_t> {};

TEST_P(RandomSets, agree_with_the_cpu_tracer) {
  RandomScene options;
  options.width = 64;
  options.height = 48;
  options.lights = GetParam() % 2 == 0 ? 2 : 0;
  options.lens = GetParam() % 3 == 0;
  options.removed_objects = GetParam() % 2 == 1 ? 1 : 0;
  expect_agreement(random_scene(GetParam(), options), 32, 32);
}

// Six consecutive seeds put each material on the first virtual object.
INSTANTIATE_TEST_SUITE_P(Seeds, RandomSets, ::testing::Range(1u, 7u));

}  // namespace
}  // namespace previz::testing
