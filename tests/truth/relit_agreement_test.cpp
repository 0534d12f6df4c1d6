// Lamps that were taken out of an environment and changed in the mixed world, against the CPU
// tracer.
#include "daemon/core/lighting/claims.hpp"
#include "daemon/core/lighting/light_mode.hpp"
#include "daemon/core/pipeline/relight.hpp"
#include "tests/truth/two_tracers.hpp"

namespace previz::test::relit_agreement_test {

constexpr double degree = 0.017453292519943295;
constexpr int samples = 32;

struct Lamp {
  glm::dvec3 direction;
  glm::vec3 radiance;
  double gain_mixed;
  glm::dvec3 tint;
};
const Lamp lamps[] = {
    {{0, std::cos(50 * degree), std::sin(50 * degree)}, {200, 150, 100}, 0.3, {1, 1, 1}},
    {{std::cos(70 * degree), 0, std::sin(70 * degree)}, {60, 80, 120}, 1, {1, 0.7, 0.4}}};
constexpr double lamp_radius = 3 * degree, cone = 5 * degree;

bool is_in(const Lamp& lamp, const glm::dvec3& direction, double radius) {
  return glm::dot(direction, lamp.direction) > std::cos(radius);
}

// Two lamps over a grey sky that is brighter to one side, as the real or as the mixed world has it.
lighting::EnvironmentMap sky(bool mixed) {
  lighting::EnvironmentMap map{128, {}};
  for (int j = 0; j < map.size; ++j)
    for (int i = 0; i < map.size; ++i) {
      const glm::dvec3 direction(lighting::texel_direction(map.size, i, j));
      glm::dvec3 radiance(0.3 + 0.1 * direction.x);
      for (const Lamp& lamp : lamps)
        if (is_in(lamp, direction, lamp_radius))
          radiance +=
              glm::dvec3(lamp.radiance) * (mixed ? lamp.gain_mixed * lamp.tint : glm::dvec3(1));
      map.radiance.emplace_back(radiance);
    }
  return map;
}

// A real floor with a real box, and a virtual ball.
View stage() {
  View view = empty_view({0, -1.2, 0.8}, {0, 0, 0.1}, pinhole(64, 48, 0.7));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.6)));
  add(view.scene, box_mesh({0.2, 0.2, 0.2}), diffuse({0.7f, 0.5f, 0.3f}), at({-0.35, 0.1, 0.1}));
  add(view.scene, icosphere_mesh(0.2, 3), diffuse(glm::vec3(0.8)), at({0.1, 0, 0.2}),
      scene::world_mixed);
  view.environment = sky(false);
  return view;
}

struct Parted {
  lighting::EnvironmentMap rest;
  std::vector<set::Light> lamps;
};

Parted parted(const lighting::EnvironmentMap& map) {
  std::vector<lighting::Claim> claims;
  set::Set set;
  for (const Lamp& lamp : lamps) {
    claims.push_back({std::to_string(claims.size()), lamp.direction, cone, {}});
    set.captured_lamps.push_back({claims.back().lamp, lamp.direction, {}, cone});
  }
  pipeline::Light light;
  light.lighting.environment = map;
  const lighting::Claims all(claims, map.size, [](const glm::dvec3& d) { return d; });
  for (const lighting::Source& source : all.take_out(light.lighting.environment, {})) {
    const Lamp& from = lamps[source.claim];
    set::Light lamp = lighting::lamps_of({source}, glm::dvec3(0), [](const glm::dvec3&) {
                        return std::optional<double>();
                      }).front();
    lamp.name = claims[static_cast<std::size_t>(source.claim)].lamp;
    lamp.gain_mixed = from.gain_mixed;
    lamp.tint = from.tint;
    light.lamps.push_back(lamp);
  }
  return {light.lighting.environment, pipeline::relit(light, set, {})};
}

struct Pictures {
  Worlds worlds;
  truth::Scrambles difference;
};

Pictures by_renderer(const View& view, const Parted& light, set::Estimator estimator,
                     std::uint32_t first_seed) {
  Pictures result{{no_pictures(view), no_pictures(view)}, no_pictures(view)};
  SetRenderer renderer(view, {.estimator = estimator});
  renderer.set_environment(light.rest, set::LightSampling::importance);
  renderer.set_sources(light.lamps);
  for (std::uint32_t i = 0; i < scrambles; ++i) {
    const render::Layers layers = renderer.rendered_clean(samples, first_seed + i);
    result.worlds.mixed.pictures.push_back(widen(layers.mixed));
    result.worlds.real.pictures.push_back(widen(layers.real));
    result.difference.pictures.push_back(widen(layers.diff));
  }
  return result;
}

truth::Scrambles by_cpu(const View& view, const lighting::EnvironmentMap& map,
                        const std::vector<set::Light>& its_lamps, std::uint32_t world) {
  scene::Scene scene = view.scene;
  for (const set::Light& lamp : its_lamps) {
    scene.lights.push_back(lamp);
    scene.light_objects.push_back(scene::no_object);
  }
  truth::Scrambles result = no_pictures(view);
  truth::CpuTracer tracer(scene, map);
  for (int i = 0; i < scrambles; ++i)
    result.pictures.push_back(tracer
                                  .trace(view.calibration, view.world_from_camera, world, samples,
                                         static_cast<std::uint64_t>(2 * i + 1) + world)
                                  .mean);
  return result;
}

double mean_of(const truth::Scrambles& scrambled) {
  double sum = 0;
  std::size_t count = 0;
  for (const auto& picture : scrambled.pictures)
    for (const glm::dvec3& pixel : picture) sum += pixel.r + pixel.g + pixel.b, count += 3;
  return sum / static_cast<double>(count);
}

// The same lamps, by the tracer that knows one world at a time.
TEST(RelitLamps, AreThoseOfTheCpuTracerInBothWorlds) {
  const View view = stage();
  const Parted light = parted(view.environment);
  const Pictures gpu = by_renderer(view, light, set::Estimator::paired, 1000);
  const truth::Scrambles mixed = by_cpu(view, light.rest, light.lamps, scene::world_mixed);
  const truth::Scrambles real = by_cpu(view, light.rest, light.lamps, scene::world_real);
  expect_agree(gpu.worlds, {mixed, real});

  // And they light as the changed environment does: the discs that stand for them have its flux. As
  // in SourceLight, their outline moves a mean by at most 0.5 %; chance, which 16 pictures of 32
  // samples and 3072 pixels know to 1e-3, is far below.
  EXPECT_NEAR(mean_of(mixed) / mean_of(by_cpu(view, sky(true), {}, scene::world_mixed)), 1, 0.008);
  EXPECT_NEAR(mean_of(real) / mean_of(by_cpu(view, sky(false), {}, scene::world_real)), 1, 0.008);
  // The lamps bring most of the light, so a lamp that was not changed, or changed twice, is seen.
  EXPECT_LT(mean_of(mixed), 0.8 * mean_of(real));
}

TEST(RelitLamps, AreTheSameByBothEstimators) {
  const View view = stage();
  const Parted light = parted(view.environment);
  const Pictures paired = by_renderer(view, light, set::Estimator::paired, 1);
  const Pictures difference = by_renderer(view, light, set::Estimator::difference, 1001);
  expect_agree(paired.difference, difference.difference);
}

}  // namespace previz::test::relit_agreement_test
