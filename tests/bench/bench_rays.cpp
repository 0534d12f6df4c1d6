// Rays per second of our traversal beside Embree's single-ray calls: same mesh, same rays, in turns
// in one run, in CPU time of all threads, so that "a core" means a core whatever else runs here.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"
#include "tests/bench/tracers/embree_tracer.hpp"
#include "tests/bench/tracers/gpu_tracer.hpp"

namespace previz::bench {
namespace {

struct RaySets {
  std::vector<Ray> primary, diffuse, shadow;
};

// Pixels in Z order within tiles, so that neighbours in the list are neighbours in the picture.
glm::ivec2 tiled_pixel(int i, int width) {
  constexpr int tile = 16;
  const int within = i % (tile * tile);
  glm::ivec2 p(0);
  for (int bit = 0; bit < 4; ++bit) {
    p.x |= (within >> (2 * bit) & 1) << bit;
    p.y |= (within >> (2 * bit + 1) & 1) << bit;
  }
  const int tiles = width / tile;
  const int which = i / (tile * tile);
  return p + tile * glm::ivec2(which % tiles, which / tiles);
}

// Of instances that are moved and scaled, not turned.
glm::vec3 geometric_normal(const scene::Scene& scene, const TracedHit& hit) {
  const scene::Mesh& mesh = scene.meshes[scene.instances[hit.instance].mesh];
  const glm::uvec3& t = mesh.triangles[hit.primitive];
  const glm::vec3& a = mesh.positions[t.x];
  return glm::normalize(glm::cross(mesh.positions[t.y] - a, mesh.positions[t.z] - a));
}

// Primary rays of a camera that looks over the field; from each hit a cosine-distributed bounce and
// a ray to a point of a light above.
RaySets make_rays(const scene::Scene& scene, const EmbreeTracer& embree, int size) {
  float edge = 0;
  for (const glm::vec3& p : scene.meshes[0].positions) edge = std::max(edge, p.x);
  const glm::vec3 eye(-0.55f * edge, -0.75f * edge, 0.45f * edge);
  const glm::vec3 forward = glm::normalize(-eye);
  const glm::vec3 right = glm::normalize(glm::cross(forward, glm::vec3(0, 0, 1)));
  const glm::vec3 up = glm::cross(right, forward);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  RaySets sets;
  for (int i = 0; i < size * size; ++i) {
    const glm::vec2 p = (glm::vec2(tiled_pixel(i, size)) + 0.5f) / static_cast<float>(size) - 0.5f;
    const Ray ray{eye, 0, glm::normalize(forward + p.x * right - p.y * up), 1e30f};
    sets.primary.push_back(ray);
    const TracedHit hit = embree.closest(ray, scene::world_both);
    if (hit.t < 0) continue;
    glm::vec3 n = geometric_normal(scene, hit);
    if (glm::dot(n, ray.direction) > 0) n = -n;
    const glm::vec3 at = ray.origin + hit.t * ray.direction + 1e-4f * n;
    const float z = 1 - 2 * uniform(random);
    const float phi = 2 * std::numbers::pi_v<float> * uniform(random);
    const float r = std::sqrt(std::max(0.0f, 1 - z * z));
    const glm::vec3 bounce = n + glm::vec3(r * std::cos(phi), r * std::sin(phi), z);
    sets.diffuse.push_back({at, 0, glm::normalize(bounce), 1e30f});
    const glm::vec3 light(edge * (uniform(random) - 0.5f), edge * (uniform(random) - 0.5f), edge);
    sets.shadow.push_back({at, 0, light - at, 1.0f});
  }
  return sets;
}

struct Measured {
  double ours = 0, embree = 0;          // median Mrays/s a core
  double ratio = 0, low = 0, high = 0;  // median and extremes over the rounds
};

template <typename Ours, typename Theirs>
Measured measure(std::size_t rays, int rounds, const Ours& ours, const Theirs& theirs) {
  std::vector<double> our_rates, their_rates, ratios;
  ours();  // compiles the pipeline
  for (int round = 0; round < rounds; ++round) {
    const double start = cpu_seconds();
    ours();
    const double middle = cpu_seconds();
    theirs();
    const double end = cpu_seconds();
    our_rates.push_back(1e-6 * static_cast<double>(rays) / (middle - start));
    their_rates.push_back(1e-6 * static_cast<double>(rays) / (end - middle));
    ratios.push_back(our_rates.back() / their_rates.back());
  }
  return {median(our_rates), median(their_rates), median(ratios),
          *std::min_element(ratios.begin(), ratios.end()),
          *std::max_element(ratios.begin(), ratios.end())};
}

// Share of rays on which the two tracers disagree by more than rounding: a wrong result is not
// fast.
double disagreement(const std::vector<float>& ours, const std::vector<float>& theirs) {
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < ours.size(); ++i)
    if (std::abs(ours[i] - theirs[i]) > 1e-4f * (1 + std::abs(theirs[i]))) ++wrong;
  return static_cast<double>(wrong) / static_cast<double>(ours.size());
}

void print(const char* kind, const Measured& m, double wrong) {
  std::printf("| %-7s | %6.2f | %6.2f | %5.2f | %.2f to %.2f | %.0e |\n", kind, m.ours, m.embree,
              m.ratio, m.low, m.high, wrong);
  std::fflush(stdout);
}

struct Options {
  std::vector<std::size_t> triangles{4'000, 98'000, 582'000, 1'000'000};
  int size = 512;
  int rounds = 7;
  bool instanced = false;
};

void run(render::Device& device, std::size_t triangles, const Options& options) {
  const scene::Scene scene =
      options.instanced ? instanced_field(triangles) : scene_of(sphere_field(triangles));
  const EmbreeTracer embree(scene, RTC_BUILD_QUALITY_HIGH, false);
  std::vector<scene::MeshBvh> meshes;
  const double start = cpu_seconds();
  for (const scene::Mesh& mesh : scene.meshes)
    meshes.push_back(build_mesh_bvh(mesh, scene::BvhQuality::high));
  const double built = cpu_seconds() - start;
  GpuTracer ours(device, scene_texels(scene, meshes));
  const RaySets sets = make_rays(scene, embree, options.size);
  std::size_t seen = 0;
  for (const scene::Instance& instance : scene.instances)
    seen += scene.meshes[instance.mesh].triangles.size();
  std::printf(
      "\n%zu triangles in %zu instances; the last mesh: %u leaves, %u levels, SAH cost %.1f; "
      "built in %.0f ms (CPU)\n\n",
      seen, scene.instances.size(), meshes.back().leaves, meshes.back().depth,
      meshes.back().sah_cost, 1e3 * built);
  std::printf("| rays | ours, Mrays/s | Embree, Mrays/s | ratio | spread | wrong |\n");
  std::printf("| --- | --- | --- | --- | --- | --- |\n");

  const auto closest = [&](const char* kind, const std::vector<Ray>& rays) {
    ours.set_rays(rays);
    std::vector<float> theirs(rays.size());
    const Measured m = measure(
        rays.size(), options.rounds, [&] { ours.dispatch_distances(scene::world_both); },
        [&] {
          for (std::size_t i = 0; i < rays.size(); ++i)
            theirs[i] = embree.closest(rays[i], scene::world_both).t;
        });
    print(kind, m, disagreement(ours.distances(), theirs));
  };
  closest("primary", sets.primary);
  closest("diffuse", sets.diffuse);

  ours.set_rays(sets.shadow);
  std::vector<float> theirs(sets.shadow.size());
  const Measured m = measure(
      sets.shadow.size(), options.rounds, [&] { ours.dispatch_blocked(scene::world_both); },
      [&] {
        for (std::size_t i = 0; i < sets.shadow.size(); ++i)
          theirs[i] = embree.occluded(sets.shadow[i], scene::world_both) ? 1.0f : 0.0f;
      });
  std::vector<float> blocked;
  for (const std::uint32_t worlds : ours.blocked_worlds()) blocked.push_back(worlds != 0 ? 1 : 0);
  print("shadow", m, disagreement(blocked, theirs));
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Rays per second a core, ours beside Embree's single-ray calls");
  app.add_option("--triangles", options.triangles, "Sizes of the mesh");
  app.add_option("--size", options.size, "Primary rays in x and y, a multiple of 16");
  app.add_option("--rounds", options.rounds, "Rounds in turns");
  app.add_flag("--instanced", options.instanced, "One instance a sphere instead of one mesh");
  return previz::bench::run_program(app, argc, argv, [&] {
    previz::render::Device device({});
    std::printf("%s\n", device.name().c_str());
    for (const std::size_t triangles : options.triangles)
      previz::bench::run(device, triangles, options);
  });
}
