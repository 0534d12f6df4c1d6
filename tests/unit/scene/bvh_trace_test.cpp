// The traversal in the shader against Embree, ray by ray, and against brute force, world by world.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/bench/shapes.hpp"
#include "tests/bench/tracers/embree_tracer.hpp"
#include "tests/bench/tracers/gpu_tracer.hpp"
#include "tests/support/bvh_precision.hpp"
#include "tests/support/test.hpp"

namespace previz::test::bvh_trace_test {

using bench::Ray;
using bench::TracedHit;
using scene::BvhQuality;
using scene::Scene;

// What traces the rays: our trees in compute, or the device's own units.
enum class By { trees, hardware };

class BvhTrace : public testing::TestWithParam<By> {
 protected:
  static void SetUpTestSuite() {
    render::DeviceOptions options{.validation = true, .name = ""};
    options.hardware_rays = false;
    trees_ = std::make_unique<render::Device>(options);
    options.hardware_rays = true;
    hardware_ = std::make_unique<render::Device>(options);
  }
  static void TearDownTestSuite() {
    for (std::unique_ptr<render::Device>* device : {&trees_, &hardware_}) {
      EXPECT_EQ((*device)->validation_messages(), 0u);
      device->reset();
    }
  }
  void SetUp() override {
    if (GetParam() == By::hardware && !hardware_->traces_in_hardware())
      GTEST_SKIP() << hardware_->name() << " has no VK_KHR_ray_query";
  }
  // Returns how many of so many rays at edges may leak. Vulkan wants its triangles to be
  // watertight, but those of Mesa's CPU device are not.
  std::size_t most_leaks(std::size_t rays) {
    return GetParam() == By::hardware && device().is_cpu() ? rays / 10 : 0;
  }
  render::Device& device() { return GetParam() == By::trees ? *trees_ : *hardware_; }

 private:
  static inline std::unique_ptr<render::Device> trees_, hardware_;
};

INSTANTIATE_TEST_SUITE_P(Rays, BvhTrace, testing::Values(By::trees, By::hardware),
                         [](const auto& param) {
                           return param.param == By::trees ? "ByTrees" : "ByHardware";
                         });

class TreesOnACard : public testing::Test {
 protected:
  ~TreesOnACard() override { EXPECT_EQ(device_.validation_messages(), 0u); }
  render::Device device_{render::DeviceOptions{.validation = true, .name = ""}};
};

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  float uniform(float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(engine_);
  }
  glm::vec3 in_cube(float half_edge) {
    return {uniform(-half_edge, half_edge), uniform(-half_edge, half_edge),
            uniform(-half_edge, half_edge)};
  }
  std::uint32_t below(std::size_t n) {
    return static_cast<std::uint32_t>(
        std::uniform_int_distribution<std::size_t>(0, n - 1)(engine_));
  }

 private:
  std::mt19937 engine_;
};

// From places in a cube towards places in a smaller one, of any length.
std::vector<Ray> rays_across(std::size_t count, float from, float to, std::uint32_t seed) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    ray.origin = random.in_cube(from);
    ray.direction = (random.in_cube(to) - ray.origin) * random.uniform(0.01f, 10.0f);
  }
  return rays;
}

void expect_agreement(render::Device& device, const Scene& scene, std::span<const Ray> rays,
                      std::uint32_t worlds, double least_hit_share) {
  bench::GpuTracer ours(device, scene, BvhQuality::medium);
  const bench::EmbreeTracer embree(scene, RTC_BUILD_QUALITY_MEDIUM, true);
  const std::vector<TracedHit> hits = ours.closest(rays, worlds);
  std::size_t wrong = 0, found = 0, wrong_presence = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const TracedHit expected = embree.closest(rays[i], worlds);
    if (hits[i].t >= 0) {
      ++found;
      const std::uint32_t presence = scene.instances[hits[i].instance].presence;
      wrong_presence += hits[i].presence != presence || (presence & worlds) == 0;
    }
    if (agree(scene, rays[i], hits[i], expected)) continue;
    if (++wrong <= 3)
      ADD_FAILURE() << "ray " << i << ": t " << hits[i].t << " at " << hits[i].instance << "/"
                    << hits[i].primitive << ", Embree " << expected.t << " at " << expected.instance
                    << "/" << expected.primitive;
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(wrong_presence, 0u);
  EXPECT_GT(static_cast<double>(found), least_hit_share * static_cast<double>(rays.size()));
}

TEST_P(BvhTrace, AgreesWithEmbreeOnRandomTriangles) {
  expect_agreement(device(), bench::scene_of(bench::random_triangles(3000, 1, 0.2f, 1)),
                   rays_across(20'000, 2, 1, 2), scene::world_both, 0.5);
  expect_agreement(device(), bench::scene_of(bench::random_triangles(1, 1, 1, 1)),
                   rays_across(2'000, 3, 1, 3), scene::world_both, 0.01);
}

TEST_P(BvhTrace, AgreesWithEmbreeOnABumpySphereFromInsideAndOutside) {
  const Scene scene = bench::scene_of(bench::bumpy_sphere(5, 1.0, 0.3, 1));
  expect_agreement(device(), scene, rays_across(20'000, 3, 1, 4), scene::world_both, 0.3);
  expect_agreement(device(), scene, rays_across(20'000, 0.3f, 1, 5), scene::world_both, 0.99);
}

TEST_P(BvhTrace, AgreesWithEmbreeOnSlivers) {
  Random random(6);
  scene::Mesh mesh;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const glm::vec3 a = random.in_cube(1), b = random.in_cube(1);
    mesh.positions.insert(mesh.positions.end(), {a, b, b + random.in_cube(1e-4f)});
    mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  expect_agreement(device(), bench::scene_of(mesh), rays_across(20'000, 2, 1, 7), scene::world_both,
                   0.001);
}

TEST_P(BvhTrace, AgreesWithEmbreeAtAnyScaleAndPlace) {
  for (const float scale : {1e-3f, 1e3f}) {
    for (const glm::vec3 offset : {glm::vec3(0), glm::vec3(1000, -300, 50)}) {
      scene::Mesh mesh = bench::bumpy_sphere(3, scale, 0.3, 1);
      for (glm::vec3& p : mesh.positions) p += offset;
      std::vector<Ray> rays = rays_across(5'000, 2 * scale, scale, 8);
      for (Ray& ray : rays) ray.origin += offset;
      expect_agreement(device(), bench::scene_of(mesh), rays, scene::world_both, 0.2);
    }
  }
}

TEST_P(BvhTrace, AgreesWithEmbreeOnAMillionTrianglesInOnePixel) {
  scene::Mesh mesh = bench::random_triangles(1'000'000, 0.05f, 5e-4f, 9);
  std::vector<Ray> rays(4000);
  Random random(10);
  // A pixel of 0.1 m at 100 m.
  for (Ray& ray : rays)
    ray = {
        {0, 0, 100}, 0, {random.uniform(-5e-4f, 5e-4f), random.uniform(-5e-4f, 5e-4f), -1}, 1e30f};
  expect_agreement(device(), bench::scene_of(std::move(mesh)), rays, scene::world_both, 0.5);
}

TEST_P(BvhTrace, AgreesWithEmbreeAlongTheAxes) {
  std::vector<Ray> rays;
  Random random(11);
  for (int i = 0; i < 6000; ++i) {
    glm::vec3 direction(0);
    direction[i % 3] = i % 2 ? 1.0f : -1.0f;
    if (i % 4 == 0) direction[(i + 1) % 3] = -0.0f;
    rays.push_back({random.in_cube(2), 0, direction, 1e30f});
  }
  expect_agreement(device(), bench::scene_of(bench::random_triangles(3000, 1, 0.2f, 12)), rays,
                   scene::world_both, 0.1);
  expect_agreement(device(), bench::scene_of(bench::grid(4, 16)), rays, scene::world_both, 0.1);
}

// Instances of a few meshes, turned, scaled, mirrored, present in various worlds.
Scene many_instances(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  Scene scene;
  scene.meshes = {bench::bumpy_sphere(2, 0.4, 0.3, 1), bench::random_triangles(40, 0.5f, 0.3f, 2),
                  bench::grid(0.8f, 3)};
  for (std::size_t i = 0; i < count; ++i) {
    scene::Instance instance;
    instance.mesh = random.below(scene.meshes.size());
    instance.presence = 1 + static_cast<std::uint32_t>(i % 3);
    glm::dmat4 m = glm::translate(glm::dmat4(1), glm::dvec3(random.in_cube(2)));
    m = glm::rotate(m, static_cast<double>(random.uniform(0, 6)), glm::dvec3(random.in_cube(1)));
    glm::dvec3 scale(random.uniform(0.4f, 2), random.uniform(0.4f, 2), random.uniform(0.4f, 2));
    if (i % 3 == 0) scale.x = -scale.x;
    instance.world_from_object = glm::scale(m, scale);
    scene.instances.push_back(instance);
  }
  return scene;
}

TEST_P(BvhTrace, AgreesWithEmbreeOnInstancesInEveryWorld) {
  for (const std::size_t count : {2, 3, 40}) {
    const Scene scene = many_instances(count, 13);
    for (const std::uint32_t worlds : {scene::world_mixed, scene::world_real, scene::world_both})
      expect_agreement(device(), scene, rays_across(8'000, 4, 1.5f, 14), worlds, 0.01);
  }
}

TEST_P(BvhTrace, BarycentricsAreThoseOfThePrimitivesCorners) {
  const Scene scene = many_instances(20, 15);
  const std::vector<Ray> rays = rays_across(8'000, 4, 1.5f, 16);
  bench::GpuTracer ours(device(), scene, BvhQuality::medium);
  const std::vector<TracedHit> hits = ours.closest(rays, scene::world_both);
  std::size_t checked = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].t < 0) continue;
    const ExactHit exact = exact_hit(scene, hits[i].instance, hits[i].primitive, rays[i]);
    if (!exact.proper || exact.weight_error > 1e-2) continue;
    ++checked;
    EXPECT_NEAR(hits[i].barycentrics.x, exact.weights[1], exact.weight_error + 1e-6);
    EXPECT_NEAR(hits[i].barycentrics.y, exact.weights[2], exact.weight_error + 1e-6);
    EXPECT_NEAR(hits[i].t, exact.t, exact.t_error);
  }
  EXPECT_GT(checked, 2000u);
}

TEST_P(BvhTrace, ShadowRaysSayInWhichWorldsTheyAreBlocked) {
  const Scene scene = many_instances(12, 17);
  std::vector<Ray> rays = rays_across(4'000, 3, 2, 18);
  Random random(19);
  for (Ray& ray : rays) {
    ray.t_min = random.uniform(0, 0.02f);
    ray.t_max = random.uniform(0, 3) / glm::length(ray.direction);
  }
  bench::GpuTracer ours(device(), scene, BvhQuality::medium);
  for (const std::uint32_t worlds : {scene::world_mixed, scene::world_real, scene::world_both}) {
    const std::vector<std::uint32_t> blocked = ours.blocked(rays, worlds);
    std::size_t seen[4] = {}, doubtful = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      // What surely blocks must be in the answer, what cannot must not.
      std::uint32_t surely = 0, possibly = 0;
      for (std::uint32_t k = 0; k < scene.instances.size(); ++k) {
        const auto& triangles = scene.meshes[scene.instances[k].mesh].triangles;
        for (std::uint32_t p = 0; p < triangles.size(); ++p) {
          const ExactHit hit = exact_hit(scene, k, p, rays[i]);
          const double e = hit.t_error;
          if (hit.surely() && hit.t > rays[i].t_min + e && hit.t < rays[i].t_max - e)
            surely |= scene.instances[k].presence;
          if (hit.possibly() && hit.t > rays[i].t_min - e && hit.t < rays[i].t_max + e)
            possibly |= scene.instances[k].presence;
        }
      }
      surely &= worlds;
      possibly &= worlds;
      EXPECT_EQ(blocked[i] & surely, surely) << i;
      EXPECT_EQ(blocked[i] & ~possibly, 0u) << i;
      ++seen[blocked[i]];
      doubtful += surely != possibly;
    }
    EXPECT_LT(doubtful, rays.size() / 100);
    for (std::uint32_t answer = 0; answer < 4; ++answer)
      EXPECT_EQ(seen[answer] > 20, (answer & ~worlds) == 0) << answer << " of " << worlds;
  }
}

// From inside a closed mesh through its edges and vertices, where a leak would be.
std::vector<Ray> rays_at_edges(const scene::Mesh& mesh, const glm::dmat4& world_from_object,
                               std::size_t count, float half_edge) {
  Random random(20);
  std::vector<Ray> rays(count);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::uvec3& t = mesh.triangles[random.below(mesh.triangles.size())];
    const double s = i % 2 ? random.uniform(0, 1) : 0.0;  // on the edge, or its first vertex
    const glm::dvec3 target =
        glm::mix(glm::dvec3(mesh.positions[t.x]), glm::dvec3(mesh.positions[t.y]), s);
    const glm::dvec3 from(random.in_cube(half_edge));
    const glm::dvec3 a(world_from_object * glm::dvec4(from, 1.0));
    const glm::dvec3 b(world_from_object * glm::dvec4(target, 1.0));
    rays[i] = {glm::vec3(a), 0, glm::vec3(b - a), 1e30f};
  }
  return rays;
}

std::size_t leaks(render::Device& device, const Scene& scene, std::span<const Ray> rays) {
  bench::GpuTracer ours(device, scene, BvhQuality::high);
  std::size_t result = 0;
  for (const TracedHit& hit : ours.closest(rays, scene::world_both)) result += hit.t < 0;
  for (const std::uint32_t blocked : ours.blocked(rays, scene::world_both)) result += blocked == 0;
  return result;
}

// Squares around the origin, each twice as large as the last and a little behind it: their tree is
// as deep as one may be.
scene::Mesh nested_squares(int count) {
  scene::Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const float half_edge = std::ldexp(1.0f, i - count);
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const glm::vec2 corner : {glm::vec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
      mesh.positions.emplace_back(half_edge * corner, -half_edge);
    mesh.triangles.emplace_back(first, first + 1, first + 2);
    mesh.triangles.emplace_back(first, first + 2, first + 3);
  }
  return mesh;
}

void expect_the_same_on_a_card(render::Device& device, const Scene& scene,
                               std::span<const Ray> rays) {
  const auto texels = bench::scene_texels(scene, BvhQuality::medium);
  const std::uint32_t bits = render::device_bits(device);
  bench::GpuTracer on_cpu(device, texels, bits & ~gpu::DEVICE_IS_CARD);
  bench::GpuTracer on_card(device, texels, bits | gpu::DEVICE_IS_CARD);
  std::size_t found = 0, other = 0;
  const std::vector<TracedHit> expected = on_cpu.closest(rays, scene::world_both);
  const std::vector<TracedHit> hits = on_card.closest(rays, scene::world_both);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    found += expected[i].t >= 0;
    const auto parts = [](const TracedHit& hit) {
      return std::tuple(hit.t, hit.barycentrics.x, hit.barycentrics.y, hit.instance, hit.primitive,
                        hit.presence);
    };
    other += parts(expected[i]) != parts(hits[i]);
  }
  EXPECT_EQ(other, 0u);
  EXPECT_GT(found, rays.size() / 10);
  EXPECT_EQ(on_cpu.blocked(rays, scene::world_both), on_card.blocked(rays, scene::world_both));
}

TEST_F(TreesOnACard, AreTheSame) {
  Scene scene = bench::scene_of(bench::random_triangles(3000, 1, 0.2f, 1));
  for (int i = 1; i < 40; ++i) {
    scene.instances.push_back(scene.instances[0]);
    scene.instances.back().world_from_object =
        glm::rotate(glm::dmat4(1), 0.1 * i, glm::dvec3(1, 2, 3));
  }
  expect_the_same_on_a_card(device_, scene, rays_across(20'000, 2, 1, 2));
}

TEST_F(TreesOnACard, AreTheSameWhereDeep) {
  Scene scene = bench::scene_of(nested_squares(100));
  EXPECT_GE(scene::build_mesh_bvh(scene.meshes[0]).depth, 12u);
  for (int i = 1; i < 30; ++i) {  // the levels above
    scene.instances.push_back(scene.instances[0]);
    scene.instances.back().world_from_object =
        glm::scale(glm::dmat4(1), glm::dvec3(std::ldexp(1.0, -i)));
  }
  std::vector<Ray> rays;
  Random random(23);
  for (int i = 0; i < 20'000; ++i) {
    const float far = std::ldexp(1.0f, -static_cast<int>(random.below(150)));
    rays.push_back(
        {far * random.in_cube(1), 0, {random.in_cube(0.3f) - glm::vec3(0, 0, 1)}, 1e30f});
  }
  expect_the_same_on_a_card(device_, scene, rays);
}

TEST_P(BvhTrace, NothingLeaksThroughAClosedMesh) {
  Scene scene = bench::scene_of(bench::bumpy_sphere(4, 1.0, 0.3, 1));
  const scene::Mesh& mesh = scene.meshes[0];
  EXPECT_LE(leaks(device(), scene, rays_at_edges(mesh, glm::dmat4(1), 1'000'000, 0.3f)),
            most_leaks(1'000'000));

  glm::dmat4 placed = glm::translate(glm::dmat4(1), glm::dvec3(30, -20, 10));
  placed = glm::scale(glm::rotate(placed, 1.0, glm::dvec3(1, 2, 3)), glm::dvec3(1e-2, 2e-2, 3e-2));
  scene.instances[0].world_from_object = placed;
  scene.instances.push_back(scene.instances[0]);
  scene.instances[1].world_from_object[3] += glm::dvec4(1, 1, 1, 0);
  EXPECT_LE(leaks(device(), scene, rays_at_edges(mesh, placed, 200'000, 0.3f)),
            most_leaks(200'000));
}

TEST_P(BvhTrace, NothingLeaksThroughABoxOnTheGrid) {
  // Planes on whole numbers: boxes without a hair's breadth to spare.
  scene::Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                    {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  const Scene scene = bench::scene_of(mesh);
  EXPECT_LE(leaks(device(), scene, rays_at_edges(mesh, glm::dmat4(1), 500'000, 1.0f)),
            most_leaks(500'000));
}

TEST_P(BvhTrace, OfSurfacesInOnePlaceTheLowerInstanceWins) {
  // The same tilted square three times, by different transforms that put it in the same place.
  Scene scene;
  scene.meshes = {bench::grid(2, 5), bench::grid(1, 3)};
  glm::dmat4 tilt = glm::rotate(glm::dmat4(1), 0.7, glm::dvec3(1, 2, 0.3));
  tilt[3] = {3, -2, 1, 1};
  for (const std::uint32_t mesh : {0u, 1u, 0u}) {
    scene::Instance instance;
    instance.mesh = mesh;
    instance.world_from_object = mesh == 0 ? tilt : glm::scale(tilt, glm::dvec3(2, 2, 1));
    scene.instances.push_back(instance);
  }
  scene.instances[2].world_from_object =
      glm::rotate(scene.instances[2].world_from_object, 0.5 * 3.14159265358979, {0, 0, 1});
  Random random(21);
  std::vector<Ray> rays(20'000);
  for (Ray& ray : rays) {
    const glm::dvec4 on(random.uniform(-0.99f, 0.99f), random.uniform(-0.99f, 0.99f), 0, 1);
    ray.origin = glm::vec3(3, -2, 1) + random.in_cube(5);
    ray.direction = glm::vec3(glm::dvec3(tilt * on) - glm::dvec3(ray.origin));
  }
  for (int order = 0; order < 3; ++order) {
    bench::GpuTracer ours(device(), scene, BvhQuality::medium);
    std::size_t other = 0;
    const auto hits = ours.closest(rays, scene::world_both);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      // Not those that graze the plane, where rounding along the ray is without bound.
      const glm::vec3 normal(tilt[2]);
      if (std::abs(glm::dot(normal, glm::normalize(rays[i].direction))) < 0.1f) continue;
      other += hits[i].instance != 0;
    }
    EXPECT_EQ(other, 0u) << "order " << order;
    std::rotate(scene.instances.begin(), scene.instances.begin() + 1, scene.instances.end());
  }
}

TEST_P(BvhTrace, OfTrianglesInOnePlaceTheLowerPrimitiveWins) {
  scene::Mesh mesh = bench::grid(2, 4);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  for (std::uint32_t i = 0; i < 2 * count; ++i) mesh.triangles.push_back(mesh.triangles[i % count]);
  std::vector<Ray> rays;
  Random random(22);
  for (int i = 0; i < 5000; ++i)
    rays.push_back({{random.uniform(-1, 1), random.uniform(-1, 1), 1}, 0, {0.1f, 0.05f, -1}, 10});
  bench::GpuTracer ours(device(), bench::scene_of(mesh), BvhQuality::medium);
  for (const TracedHit& hit : ours.closest(rays, scene::world_both)) {
    const bool lower = hit.t < 0 || hit.primitive < count;
    EXPECT_TRUE(lower) << hit.primitive;
  }
}

TEST_P(BvhTrace, TheEndsOfARayAreOutsideIt) {
  const Scene scene = bench::scene_of(bench::grid(2, 1));
  bench::GpuTracer ours(device(), scene, BvhQuality::medium);
  const glm::vec3 origin(0.3f, 0.1f, 1), down(0, 0, -2);  // t = 0.5 at the square
  const std::vector<Ray> rays{{origin, 0, down, 1},         {origin, 0, down, 0.5f},
                              {origin, 0.5f, down, 1},      {origin, 0.49f, down, 0.51f},
                              {origin, 0.51f, down, 1e30f}, {origin, 0, -down, 1e30f}};
  const std::vector<bool> expected{true, false, false, true, false, false};
  const auto hits = ours.closest(rays, scene::world_both);
  const auto blocked = ours.blocked(rays, scene::world_both);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(hits[i].t >= 0, expected[i]) << i;
    EXPECT_EQ(blocked[i] != 0, expected[i]) << i;
  }
  EXPECT_FLOAT_EQ(hits[0].t, 0.5f);
}

TEST_P(BvhTrace, AnEmptySceneIsNeverHit) {
  Scene scene;
  const std::vector<Ray> rays = rays_across(1000, 1, 1, 23);
  bench::GpuTracer nothing(device(), scene, BvhQuality::medium);
  for (const TracedHit& hit : nothing.closest(rays, scene::world_both)) EXPECT_LT(hit.t, 0);
  scene.meshes.resize(1);
  scene.instances.resize(3);
  bench::GpuTracer empty(device(), scene, BvhQuality::medium);
  for (const std::uint32_t blocked : empty.blocked(rays, scene::world_both)) EXPECT_EQ(blocked, 0u);
}

TEST_P(BvhTrace, EmptySlotsDoNotMatterHoweverFarTheRay) {
  // So far away that the slack is wider than an inverted box.
  scene::Mesh mesh = bench::random_triangles(3, 1, 1, 24);
  std::vector<Ray> rays;
  Random random(25);
  for (int i = 0; i < 2000; ++i) {
    const glm::vec3 away = glm::normalize(random.in_cube(1)) * 1e5f;
    rays.push_back({away, 0, (random.in_cube(1) - away) * 1e-5f, 1e30f});
  }
  expect_agreement(device(), bench::scene_of(mesh), rays, scene::world_both, 0.001);
}

}  // namespace previz::test::bvh_trace_test
