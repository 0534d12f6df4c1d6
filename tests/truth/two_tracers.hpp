// Compares the GPU renderer with the independent CPU tracer, and its estimators with each other, on
// a view of a test.
#pragma once

#include <cstdint>
#include <vector>

#include "tests/support/figure.hpp"
#include "tests/support/render_fixture.hpp"
#include "tests/truth/agreement.hpp"
#include "tests/truth/cpu_tracer.hpp"

namespace previz::test {

inline constexpr int scrambles = 16;

struct Worlds {
  truth::Scrambles mixed, real;
};

inline std::vector<glm::dvec3> widen(const std::vector<glm::vec3>& layer) {
  return {layer.begin(), layer.end()};
}

inline Worlds sized(const View& view) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  return {{k.width, k.height, {}}, {k.width, k.height, {}}};
}

inline Worlds gpu_scrambles(const View& view, int samples, bool caustics, std::uint32_t first_seed,
                            const std::vector<scene::Shape>& shapes = {}) {
  Worlds worlds = sized(view);
  set::Estimation estimation;
  estimation.caustics = caustics ? set::Caustics::traced : set::Caustics::none;
  render::Renderer renderer(shared_device(), estimation, view.calibration);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, set::LightSampling::importance);
  renderer.deform(shapes);
  for (std::uint32_t i = 0; i < scrambles; ++i) {
    render::FrameInput frame;
    frame.world_from_camera = view.world_from_camera;
    frame.seed = first_seed + i;
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
inline Worlds cpu_scrambles(const View& view, int samples, bool caustics) {
  Worlds worlds = sized(view);
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
// The GPU deforms the meshes to `shapes`; the CPU tracer is given them in those shapes.
inline void expect_agreement(const View& view, int samples, bool caustics,
                             const std::vector<scene::Shape>& shapes = {}) {
  const Worlds gpu = gpu_scrambles(view, samples, caustics, 1000, shapes);
  View still = view;
  still.scene = posed(view.scene, shapes);
  const Worlds cpu = cpu_scrambles(still, samples, caustics);
  const truth::Agreement mixed = truth::agreement(gpu.mixed, cpu.mixed);
  EXPECT_TRUE(mixed.agree) << "mixed: " << mixed.report();
  const truth::Agreement real = truth::agreement(gpu.real, cpu.real);
  EXPECT_TRUE(real.agree) << "real: " << real.report();
}

// The same picture by both estimators.
inline void expect_same_difference(const View& view, int samples, bool caustics,
                                   const std::vector<scene::Shape>& shapes = {}) {
  const auto scrambled = [&](set::Estimator estimator, std::uint32_t first_seed) {
    set::Estimation estimation;
    estimation.estimator = estimator;
    if (!caustics) estimation.caustics = set::Caustics::none;
    render::Renderer renderer(shared_device(), estimation, view.calibration);
    renderer.set_scene(view.scene);
    renderer.set_environment(view.environment, set::LightSampling::importance);
    renderer.deform(shapes);
    truth::Scrambles result;
    result.width = view.calibration.intrinsics.width;
    result.height = view.calibration.intrinsics.height;
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer.begin({{}, 1.0, view.world_from_camera, first_seed + i});
      renderer.render(samples);
      expect_clean(renderer.counters());
      result.pictures.push_back(widen(renderer.layers().composite));
    }
    return result;
  };
  const truth::Agreement agreement = truth::agreement(scrambled(set::Estimator::paired, 1),
                                                      scrambled(set::Estimator::difference, 1001));
  EXPECT_TRUE(agreement.agree) << agreement.report();
}

}  // namespace previz::test
