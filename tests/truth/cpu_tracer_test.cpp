// The reference tracer against closed forms. Every expectation is met within 5 standard errors of
// the estimate itself (one false alarm in 1.7 million checks) plus the stated bound of the formula.
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
using test::emitter;
using test::glass;
using test::look_at;
using test::metal;
using test::pane;
using test::plastic;
using test::uniform_environment;

constexpr double pi = std::numbers::pi;
const glm::dvec3 eye(0.3, -1.0, 1.5);

// A parallelogram around `centre` that faces cross(half_u, half_v).
std::uint32_t add_quad(scene::Scene& scene, const glm::vec3& centre, const glm::vec3& half_u,
                       const glm::vec3& half_v, const scene::Material& material) {
  scene::Mesh mesh = test::rectangle_mesh({2, 2});
  for (glm::vec3& p : mesh.positions) p = centre + p.x * half_u + p.y * half_v;
  mesh.normals.assign(4, glm::normalize(glm::cross(half_u, half_v)));
  return test::add(scene, std::move(mesh), material);
}

// A sphere around the origin of 2 n segments and n rings.
std::uint32_t add_sphere(scene::Scene& scene, double radius, int n,
                         const scene::Material& material) {
  return test::add(scene, test::uv_sphere_mesh(radius, 2 * n, n), material);
}

ObserverCalibration pinhole(int width, int height, double focal_px) {
  return test::pinhole(width, height, 2 * std::atan(0.5 * width / focal_px));
}

const ObserverCalibration one_pixel = pinhole(1, 1, 1e4);  // 1e-4 rad wide

struct Estimate {
  glm::dvec3 mean, standard_error;
};

// Radiance of the point at the origin as seen from `eye`.
Estimate radiance_of_origin(const scene::Scene& scene, const lighting::EnvironmentMap& environment,
                            int samples, const TraceOptions& options = {},
                            const glm::dvec3& from = eye) {
  CpuTracer tracer(scene, environment, options);
  const TracedPicture p =
      tracer.trace(one_pixel, look_at(from, glm::dvec3(0)), scene::world_mixed, samples, 1);
  return {p.mean[0], p.standard_error[0]};
}

void expect_radiance(const Estimate& e, const glm::dvec3& expected, double relative_bound = 1e-9) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(e.mean[c], expected[c],
                5 * e.standard_error[c] + relative_bound * std::abs(expected[c]) + 1e-12)
        << "channel " << c << ", standard error " << e.standard_error[c];
}

const lighting::EnvironmentMap no_environment = {}, white = uniform_environment(glm::vec3(1));

scene::Scene floor_of(const scene::Material& material) {
  scene::Scene scene;
  add_quad(scene, {0, 0, 0}, {50, 0, 0}, {0, 50, 0}, material);
  return scene;
}

const glm::dvec3 place(0.4, 0.2, 1.2), emission(3, 2, 1);  // of lamps

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
               4 * pi / n;
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
  ObserverCalibration calibration = pinhole(640, 480, 640);
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

TEST(CpuTracer, DiffuseFurnace) {
  for (const float albedo : {0.0F, 0.5F, 1.0F}) {
    scene::Scene scene;
    add_sphere(scene, 0.5, 32, diffuse(glm::vec3(albedo)));
    CpuTracer tracer(scene, uniform_environment({1, 2, 3}));
    // The sphere fills the picture.
    const TracedPicture p =
        tracer.trace(pinhole(8, 8, 40), look_at({0, -1, 1}, {0, 0, 0}), scene::world_mixed, 256, 1);
    // A shading normal is up to pi/64 off its facet's; the light it would gather from below the
    // facet is lost: at most (1 - cos(pi/64))/2 = 0.06 %.
    for (std::size_t i = 0; i < p.mean.size(); ++i)
      expect_radiance({p.mean[i], p.standard_error[i]},
                      static_cast<double>(albedo) * glm::dvec3(1, 2, 3), 7e-4);
  }
}

TEST(CpuTracer, GlassFurnaceLosesNothing) {
  for (const float ior : {1.0F, 1.0001F, 1.5F, 2.5F}) {
    scene::Scene scene;
    add_sphere(scene, 0.5, 256, glass(ior));
    TraceOptions options;
    options.max_depth = 64;
    CpuTracer tracer(scene, white, options);
    const TracedPicture p = tracer.trace(pinhole(8, 8, 32), look_at({0, -2, 0.1}, {0, 0, 0}),
                                         scene::world_mixed, 400, 1);
    // Every path but those absorbed by a shading normal at odds with its facet carries exactly 1;
    // with facets of 0.7 degrees that is below 1e-3.
    for (const glm::dvec3& mean : p.mean) EXPECT_NEAR(mean.x, 1, 1e-3);
  }
}

TEST(CpuTracer, SmoothMetalIsSchlick) {
  const auto scene = floor_of(metal({0.9F, 0.5F, 0.2F}, 0));
  const double c = eye.z / glm::length(eye);
  const glm::dvec3 f0(0.9F, 0.5F, 0.2F);
  const glm::dvec3 expected = f0 + (1.0 - f0) * std::pow(1 - c, 5);
  // The pixel is 1e-4 rad wide; Schlick's slope in angle is below 1.
  expect_radiance(radiance_of_origin(scene, white, 64), expected, 1e-4);
}

// What single scattering loses is given back; the table of it is off by less than 1e-3.
TEST(CpuTracer, WhiteRoughMetalAndGlassKeepAllLight) {
  for (const float roughness : {0.1F, 0.4F, 1.0F}) {
    scene::Material frosted = pane();
    frosted.roughness = roughness;
    for (const glm::dvec3& from : {glm::dvec3(0, 0, 1), glm::dvec3(1, 0, 1), glm::dvec3(1, 0, 0.2)})
      for (const scene::Material& material : {metal(glm::vec3(1), roughness), frosted})
        expect_radiance(radiance_of_origin(floor_of(material), white, 20000, {}, from),
                        glm::dvec3(1), 1e-3);
  }
}

TEST(CpuTracer, PlasticFurnaceMixesByTheFresnelTermOfTheView) {
  const glm::dvec3 base(0.5F, 0.2F, 0.8F);
  const double nv = eye.z / glm::length(eye);
  const double fresnel = fresnel_dielectric(nv, 1.5);
  const glm::dvec3 expected = (1 - fresnel) * base + fresnel * test::ggx_albedo(nv, 0.09, 1);
  const Estimate e =
      radiance_of_origin(floor_of(plastic(glm::vec3(base), std::sqrt(0.09F))), white, 40000);
  expect_radiance(e, expected, 2e-4);
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

TEST(CpuTracer, ThinPaneSumsItsInnerReflections) {
  const Estimate e =
      radiance_of_origin(floor_of(pane(glm::vec3(0.5F))), white, 20000, {}, {0, 0, 1});
  const double r = 2 * 0.04 / 1.04;
  expect_radiance(e, glm::dvec3(r + (1 - r) * 0.5), 1e-6);
}

TEST(CpuTracer, PointAndSpotLight) {
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  scene.lights = {test::point_lamp(place, emission)};
  const glm::dvec3 to_light = scene.lights[0].position;
  const double d2 = glm::dot(to_light, to_light);
  const double cosine = to_light.z / std::sqrt(d2);
  const glm::dvec3 expected = 0.5 / pi * emission * cosine / d2;
  // The pixel covers 2e-4 m of floor: relative change below 2e-4.
  expect_radiance(radiance_of_origin(scene, no_environment, 64), expected, 2e-4);

  scene.lights[0].type = set::LightType::spot;
  scene.lights[0].direction = {0, 0, -1};
  scene.lights[0].inner_cone_rad = 0.2;
  scene.lights[0].outer_cone_rad = 0.6;
  const double t = (cosine - std::cos(0.6)) / (std::cos(0.2) - std::cos(0.6));
  expect_radiance(radiance_of_origin(scene, no_environment, 64), expected * t * t * (3 - 2 * t),
                  1e-3);
}

TEST(CpuTracer, DirectionalLightOfAnySize) {
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  const glm::dvec3 direction = glm::normalize(glm::dvec3(0.3, 0.4, -1));
  const glm::dvec3 expected = 0.5 / pi * emission * -direction.z;
  for (const double radius : {0.0, 0.0046, 0.5}) {
    scene.lights = {test::sun_lamp(direction, radius, emission)};
    // A uniform disc wholly above the horizon gives cos times its facing irradiance, exactly.
    expect_radiance(radiance_of_origin(scene, no_environment, 20000), expected);
  }
}

TEST(CpuTracer, SphereLight) {
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  for (const double radius : {1e-4, 0.3, 1.1}) {
    scene.lights = {test::sphere_lamp(place, radius, emission)};
    const double d2 = glm::dot(place, place);
    const double irradiance = pi * radius * radius / d2 * place.z / std::sqrt(d2);
    // Seen past the lamp.
    expect_radiance(radiance_of_origin(scene, no_environment, 20000, {}, {-1, -1, 0.2}),
                    0.5 / pi * irradiance * emission, 5e-4);
  }
}

// Irradiance over radiance of a rectangle parallel to the receiver and centred above it.
double rectangle_irradiance(double half_a, double half_b, double height) {
  const double x = half_a / height, y = half_b / height;
  const double p = std::sqrt(1 + x * x), q = std::sqrt(1 + y * y);
  return 2 * (x / p * std::atan(y / p) + y / q * std::atan(x / q));
}

TEST(CpuTracer, RectangleLightAndEmissiveQuad) {
  const glm::dvec3 expected = 0.5 / pi * rectangle_irradiance(0.4, 0.25, 0.6) * emission;
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  scene.lights = {test::panel_lamp({0, 0, 0.6}, {0.8, 0.5}, emission)};
  expect_radiance(radiance_of_origin(scene, no_environment, 20000), expected, 1e-5);
  // It emits to one side, blocks nothing and shines into a mirror.
  scene.lights[0].direction = {0, 0, 1};
  expect_radiance(radiance_of_origin(scene, no_environment, 64), glm::dvec3(0));

  auto with_mesh = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  add_quad(with_mesh, {0, 0, 0.6F}, {0.4F, 0, 0}, {0, 0.25F, 0}, emitter({3, 2, 1}));
  expect_radiance(radiance_of_origin(with_mesh, no_environment, 20000), expected, 1e-5);
}

TEST(CpuTracer, LampsAreSeenByMirrorsAndByTheCamera) {
  auto scene = floor_of(metal(glm::vec3(1), 0));
  scene.lights = {test::sphere_lamp(glm::dvec3(-eye.x, -eye.y, eye.z) * 0.8, 0.1, emission)};
  expect_radiance(radiance_of_origin(scene, no_environment, 16), {3, 2, 1});
  scene.lights[0].position = eye * 0.5;
  expect_radiance(radiance_of_origin(scene, no_environment, 16), {3, 2, 1});
}

TEST(CpuTracer, TwoPlanesExchangeLightAsTheSeriesSays) {
  // Floor of albedo a under an emitting ceiling of albedo b, 0.1 m apart and 1000 m wide: what
  // leaves at the sides is below (0.1 / 1000)^2. Floor radiance: sum of a (ab)^k, one term for two
  // vertices; the emission behind the last vertex counts.
  const double a = 0.7F, b = 0.6F;
  for (const int depth : {1, 2, 3, 7, 16}) {
    scene::Scene scene;
    add_quad(scene, {0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}, diffuse(glm::vec3(0.7F)));
    scene::Material ceiling = diffuse(glm::vec3(0.6F));
    ceiling.emission = {1, 1, 1};
    add_quad(scene, {0, 0, 0.1F}, {1000, 0, 0}, {0, -1000, 0}, ceiling);
    double expected = 0;
    for (int k = 0; 2 * k + 1 <= depth; ++k) expected += a * std::pow(a * b, k);
    TraceOptions options;
    options.max_depth = depth;
    expect_radiance(radiance_of_origin(scene, no_environment, 4000, options, {0, -0.03, 0.05}),
                    glm::dvec3(expected), 1e-5);
  }
}

TEST(CpuTracer, WorldsSeeWhatIsPresentInThem) {
  auto scene = floor_of(diffuse({0.5F, 0.5F, 0.5F}));
  const std::uint32_t quad =
      add_quad(scene, {0, 0, 0.1F}, {0.2F, 0, 0}, {0, 0.2F, 0}, diffuse({0.1F, 0.2F, 0.3F}));
  const lighting::EnvironmentMap environment = white;
  for (const std::uint32_t presence : {scene::world_mixed, scene::world_real}) {
    scene.instances[quad].presence = presence;
    CpuTracer tracer(scene, environment);
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

TEST(CpuTracer, ScaleAndPlaceChangeNothing) {
  // Camera-relative tracing: 1 km from the origin positions in the file keep 2^-24 * 1000 m = 60
  // um, so the moved scene is placed by its instances' transforms.
  std::vector<glm::dvec3> means;
  for (const auto& [scale, offset] :
       {std::pair(1.0, 0.0), {1e-3, 0.0}, {1e3, 0.0}, {1.0, 1000.0}}) {
    scene::Scene scene;
    add_quad(scene, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, diffuse(glm::vec3(0.5F)));
    const std::uint32_t sphere = add_sphere(scene, 0.25, 32, plastic({0.8F, 0.2F, 0.1F}, 0.3F));
    scene.instances[sphere].world_from_object[3].z = 0.25;
    glm::dmat4 world(1);
    for (int i = 0; i < 3; ++i) world[i] *= scale;
    world[3] = {offset, offset, offset, 1};
    for (scene::Instance& instance : scene.instances)
      instance.world_from_object = world * instance.world_from_object;
    lighting::EnvironmentMap environment = uniform_environment({1, 1, 1}, 16);
    environment.radiance[100] = {40, 30, 20};
    CpuTracer tracer(scene, environment);
    const glm::dvec3 shift(offset);
    const TracedPicture p = tracer.trace(
        pinhole(16, 12, 20),
        look_at(shift + scale * glm::dvec3(0, -1, 0.7), shift + scale * glm::dvec3(0, 0, 0.2)),
        scene::world_mixed, 64, 9);
    glm::dvec3 mean(0);
    for (const glm::dvec3& value : p.mean) mean += value / static_cast<double>(p.mean.size());
    means.push_back(mean);
  }
  // The same random numbers: paths differ only where rounding flips a hit, about one in 1e4.
  for (const glm::dvec3& mean : means)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c] / means[0][c], 1, 5e-3);
}

}  // namespace previz::truth::cpu_tracer_test
