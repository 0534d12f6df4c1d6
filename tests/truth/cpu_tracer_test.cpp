// The parts of the reference tracer against closed forms. What it makes of lamps, interreflections
// and materials is compared with the renderer (renderer_agreement_test.cpp,
// material_agreement_test.cpp), which has closed forms of its own.
#include "tests/truth/cpu_tracer.hpp"

#include "shaders/lib/octahedral.h"
#include "tests/support/ggx_albedo.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"
#include "tests/truth/cpu_bsdf.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/cpu_environment.hpp"

namespace previz::truth::cpu_tracer_test {

using test::diffuse;
using test::look_at;
using test::uniform_environment;

const lighting::EnvironmentMap white = uniform_environment(glm::vec3(1));
const ObserverCalibration one_pixel = test::pinhole(1, 1, 1e-4);

scene::Scene floor_of(const scene::Material& material) {
  scene::Scene scene;
  test::add(scene, test::rectangle_mesh({100, 100}), material);
  return scene;
}

TEST(CpuEnvironment, MapsDirectionsAsTheSharedHeaderDoes) {
  Random random(1, 1);
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec2 p = random.uniform2() * 2.0 - 1.0;
    const glm::dvec3 d = octahedral_direction_fp64(p);
    EXPECT_NEAR(glm::length(d), 1, 1e-12);
    EXPECT_LT(glm::length(octahedral_point_fp64(d) - p), 1e-12);
    // Single precision: 2^-24 times a few operations.
    EXPECT_LT(glm::length(glm::dvec3(octahedral_direction(glm::vec2(p))) - d), 2e-6);
  }
}

TEST(CpuEnvironment, IsContinuousOverTheSquaresEdges) {
  lighting::EnvironmentMap map = uniform_environment(glm::vec3(0), 8);
  Random random(2, 1);
  for (glm::vec3& texel : map.radiance) texel = glm::vec3(static_cast<float>(random.uniform()));
  const Environment environment(map);
  for (int i = 0; i < 200; ++i) {
    const double v = 2 * random.uniform() - 1;
    // Both points are the same direction; radiance changes by at most 4 per unit of the square.
    const glm::dvec3 a = octahedral_direction_fp64({1 - 1e-9, v});
    const glm::dvec3 b = octahedral_direction_fp64({1 - 1e-9, -v});
    EXPECT_LT(glm::length(a - b), 1e-7);
    EXPECT_NEAR(environment.radiance(a).x, environment.radiance(b).x, 1e-6);
  }
}

TEST(CpuEnvironment, SamplesWithTheDensityItStates) {
  lighting::EnvironmentMap map = uniform_environment(glm::vec3(0), 8);
  Random random(3, 1);
  for (glm::vec3& texel : map.radiance)
    texel = glm::vec3(static_cast<float>(std::pow(random.uniform(), 8.0)));
  const Environment environment(map);
  double by_samples = 0;
  double uniform = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const DirectionSample s = environment.sample(random.uniform2());
    ASSERT_NEAR(environment.pdf(s.direction) / s.pdf, 1, 1e-9);
    by_samples += environment.radiance(s.direction).x / s.pdf / n;
    uniform += environment.radiance(octahedral_direction_fp64(random.uniform2() * 2.0 - 1.0)).x *
               4 * std::numbers::pi / n;
  }
  // The uniform estimate's relative standard deviation a sample is below 2: 5 * 2 / sqrt(n).
  EXPECT_NEAR(by_samples / uniform, 1, 0.023);
}

TEST(CpuCamera, InvertsTheDistortionExactly) {
  PinholeIntrinsics k{640,   480,    598.4,   600.9,  325.3, 233.1, -0.118,
                      0.041, 0.0009, -0.0007, -0.006, 0.09,  -0.03, 0.02};
  for (const glm::dvec2& pixel : {glm::dvec2(0, 0), glm::dvec2(639, 479), glm::dvec2(100, 400)}) {
    const glm::dvec3 d = undistorted_direction(k, pixel.x, pixel.y);
    const double r2 = d.x * d.x + d.y * d.y;
    const double radial = (1 + k.k1 * r2 + k.k2 * r2 * r2 + k.k3 * r2 * r2 * r2) /
                          (1 + k.k4 * r2 + k.k5 * r2 * r2 + k.k6 * r2 * r2 * r2);
    const double x = d.x * radial + 2 * k.p1 * d.x * d.y + k.p2 * (r2 + 2 * d.x * d.x);
    const double y = d.y * radial + k.p1 * (r2 + 2 * d.y * d.y) + 2 * k.p2 * d.x * d.y;
    EXPECT_NEAR(k.fx * x + k.cx, pixel.x, 1e-9);
    EXPECT_NEAR(k.fy * y + k.cy, pixel.y, 1e-9);
  }
}

TEST(CpuCamera, EveryLensRayMeetsTheFocusPoint) {
  ObserverCalibration calibration = test::pinhole(640, 480, 0.9);
  calibration.lens = ThinLens{0.0235, 2.0, 0.78};
  Random random(4, 1);
  const glm::dvec3 focus = undistorted_direction(calibration.intrinsics, 17, 300) * 0.78;
  double radius = 0;
  for (int i = 0; i < 1000; ++i) {
    const Ray ray = camera_ray(calibration, 17, 300, random);
    const glm::dvec3 to_focus = focus - ray.origin;
    EXPECT_LT(glm::length(glm::cross(ray.direction, to_focus)), 1e-12);
    radius = std::max(radius, glm::length(ray.origin));
  }
  EXPECT_LE(radius, 0.0235 / 4);
  EXPECT_GT(radius, 0.99 * 0.0235 / 4);  // 1000 uniform points: the largest r^2 is 0.999 of 1
}

// Within five standard errors (one false alarm in 1.7 million checks) and the table's bound.
TEST(CpuTracer, PlasticFurnaceMixesByTheFresnelTermOfTheView) {
  const glm::dvec3 base(0.5F, 0.2F, 0.8F), eye(0.3, -1.0, 1.5);
  const double nv = eye.z / glm::length(eye);
  const double fresnel = fresnel_dielectric(nv, 1.5);
  const glm::dvec3 expected = (1 - fresnel) * base + fresnel * test::ggx_albedo(nv, 0.09, 1);
  const auto scene = floor_of(test::plastic(glm::vec3(base), std::sqrt(0.09F)));
  CpuTracer tracer(scene, white);
  const TracedPicture p =
      tracer.trace(one_pixel, look_at(eye, glm::dvec3(0)), scene::world_mixed, 40000, 1);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(p.mean[0][c], expected[c], 5 * p.standard_error[0][c] + 2e-4 * expected[c]) << c;
}

TEST(CpuTracer, FresnelAtTheKnownAngles) {
  EXPECT_NEAR(fresnel_dielectric(1, 1.5), 0.04, 1e-12);
  EXPECT_NEAR(fresnel_dielectric(0, 1.5), 1, 1e-12);
  EXPECT_NEAR(fresnel_dielectric(1, 1), 0, 1e-12);
  EXPECT_EQ(fresnel_dielectric(0.1, 1 / 1.5), 1);  // beyond the critical angle
  // Brewster's angle: the parallel part vanishes, the other is ((1 - n^2) / (1 + n^2))^2.
  const double brewster = std::cos(std::atan(1.5));
  EXPECT_NEAR(fresnel_dielectric(brewster, 1.5), 0.5 * std::pow(1.25 / 3.25, 2), 1e-12);
}

TEST(CpuTracer, WorldsSeeWhatIsPresentInThem) {
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  const std::uint32_t quad = test::add(scene, test::rectangle_mesh({0.4, 0.4}),
                                       diffuse({0.1F, 0.2F, 0.3F}), test::at({0, 0, 0.1}));
  for (const std::uint32_t presence : {scene::world_mixed, scene::world_real}) {
    scene.instances[quad].presence = presence;
    CpuTracer tracer(scene, white);
    const auto pose = look_at({0, 0, 1}, {0, 0, 0});
    for (const std::uint32_t world : {scene::world_mixed, scene::world_real}) {
      const TracedPicture p = tracer.trace(one_pixel, pose, world, 64, 1);
      EXPECT_EQ(p.mask[0], 1) << "the worlds' first hits differ, whichever is traced";
      EXPECT_NEAR(p.depth[0], world == presence ? 0.9 : 1.0, 1e-6);
      const bool bright = world != presence;
      EXPECT_NEAR(p.mean[0].z, bright ? 0.5 : 0.3, 0.02);
    }
  }
}

}  // namespace previz::truth::cpu_tracer_test
