// Compares the GPU renderer with the independent CPU tracer, and its estimators with each other, on
// a view of a test.
#pragma once

#include "tests/support/figure.hpp"
#include "tests/support/render_fixture.hpp"
#include "tests/truth/agreement.hpp"
#include "tests/truth/cpu_tracer.hpp"

namespace previz::test {

inline constexpr int scrambles = 16;

struct Worlds {
  truth::Scrambles mixed, real;
};

inline std::vector<glm::dvec3> widen(std::span<const glm::vec3> layer) {
  return {layer.begin(), layer.end()};
}

inline truth::Scrambles no_pictures(const View& view) {
  return {view.calibration.intrinsics.width, view.calibration.intrinsics.height, {}};
}

inline void expect_agree(const truth::Scrambles& a, const truth::Scrambles& b) {
  const truth::Agreement agreement = truth::agreement(a, b);
  EXPECT_TRUE(agreement.agree) << agreement.report();
}

inline void expect_agree(const Worlds& a, const Worlds& b) {
  const truth::Agreement mixed = truth::agreement(a.mixed, b.mixed);
  EXPECT_TRUE(mixed.agree) << "mixed: " << mixed.report();
  const truth::Agreement real = truth::agreement(a.real, b.real);
  EXPECT_TRUE(real.agree) << "real: " << real.report();
}

inline Worlds gpu_scrambles(const View& view, int samples, bool caustics, std::uint32_t first_seed,
                            const std::vector<scene::Shape>& shapes = {}) {
  Worlds worlds{no_pictures(view), no_pictures(view)};
  const set::Estimation estimation{.caustics =
                                       caustics ? set::Caustics::traced : set::Caustics::none};
  SetRenderer renderer(view, estimation);
  renderer.deform(shapes);
  for (std::uint32_t i = 0; i < scrambles; ++i) {
    const render::Layers layers = renderer.rendered_clean(samples, first_seed + i);
    worlds.mixed.pictures.push_back(widen(layers.mixed));
    worlds.real.pictures.push_back(widen(layers.real));
  }
  return worlds;
}

// The CPU tracer traces each world alone, with seeds of its own.
inline Worlds cpu_scrambles(const View& view, int samples, bool caustics) {
  Worlds worlds{no_pictures(view), no_pictures(view)};
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
  expect_agree(gpu, cpu_scrambles(still, samples, caustics));
}

// The same picture by both estimators.
inline void expect_same_difference(const View& view, int samples, bool caustics,
                                   const std::vector<scene::Shape>& shapes = {}) {
  const auto scrambled = [&](set::Estimator estimator, std::uint32_t first_seed) {
    set::Estimation estimation{.estimator = estimator};
    if (!caustics) estimation.caustics = set::Caustics::none;
    SetRenderer renderer(view, estimation);
    renderer.deform(shapes);
    truth::Scrambles result = no_pictures(view);
    for (std::uint32_t i = 0; i < scrambles; ++i)
      result.pictures.push_back(widen(renderer.rendered_clean(samples, first_seed + i).composite));
    return result;
  };
  expect_agree(scrambled(set::Estimator::paired, 1), scrambled(set::Estimator::difference, 1001));
}

}  // namespace previz::test
