#include "tests/truth/cpu_tracer.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "drivers/error.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/cpu_environment.hpp"
#include "tests/truth/cpu_geometry.hpp"
#include "tests/truth/cpu_lights.hpp"
#include "tests/truth/cpu_material.hpp"

namespace previz::truth {
namespace {

constexpr int roulette_depth = 4;

double power_heuristic(double taken, double other) {
  return taken * taken / (taken * taken + other * other);
}

double largest(const glm::dvec3& c) {
  return std::max({c.x, c.y, c.z});
}

// One world seen from one camera position: all that the integrator needs.
struct World {
  const scene::Scene& scene;
  const Environment& environment;
  const Geometry& geometry;
  const TraceOptions& options;
  std::uint32_t bit;
  std::vector<set::Light> lamps;  // relative to the camera, gain applied
  EmissiveMeshes emissive;
  bool has_layers;  // surfaces that let light pass straight through
};

std::vector<set::Light> placed_lamps(const scene::Scene& scene, const glm::dvec3& origin,
                                     std::uint32_t world) {
  std::vector<set::Light> lamps = scene.lights;
  for (set::Light& lamp : lamps) {
    lamp.position -= origin;
    lamp.emission *=
        world == scene::world_mixed ? lamp.gain_mixed * lamp.tint : glm::dvec3(lamp.gain_real);
  }
  std::erase_if(lamps, [](const set::Light& lamp) { return lamp.emission == glm::dvec3(0); });
  return lamps;
}

// The same ray, from just behind what it met.
Ray resumed(const Ray& ray, const Hit& hit) {
  return {ray.origin + ray.direction * (hit.distance + 2 * hit.offset), ray.direction};
}

// The closest surface that is there, each by the odds of its alpha; only what lies behind `from`,
// which the ray has met before.
std::optional<Hit> closest_met(const scene::Scene& scene, const Geometry& geometry, const Ray& ray,
                               std::uint32_t worlds, Random& random,
                               const std::optional<Hit>& from = {}) {
  const Ray start = from ? resumed(ray, *from) : ray;
  auto hit = geometry.closest(start, worlds);
  if (hit) hit->distance += glm::dot(start.origin - ray.origin, ray.direction);
  while (hit) {
    const double coverage = coverage_at(scene, *hit);
    if (coverage >= 1 || random.uniform() < coverage) break;
    const Ray behind = resumed(ray, *hit);
    hit = geometry.closest(behind, worlds);
    if (hit) hit->distance += glm::dot(behind.origin - ray.origin, ray.direction);
  }
  return hit;
}

// A surface point of the path, ready for shading.
struct Vertex {
  const Hit& hit;
  Bsdf bsdf;
  ShadingPoint point;
  // Where a ray leaving on the viewer's side, or the other one, starts.
  glm::dvec3 start(const glm::dvec3& direction) const {
    const double side = glm::dot(direction, point.geometric_normal) < 0 ? -1 : 1;
    return hit.position + side * hit.offset * point.geometric_normal;
  }
};

// A normal whose mirror direction dips below a specular surface is turned until that grazes it.
glm::dvec3 mirroring_normal(const glm::dvec3& normal, const glm::dvec3& geometric_normal,
                            const glm::dvec3& wo) {
  const double least = std::min(0.9 * glm::dot(wo, geometric_normal), 0.01);
  const glm::dvec3 mirrored = glm::reflect(-wo, normal);
  const double height = glm::dot(mirrored, geometric_normal);
  if (height >= least) return normal;
  return glm::normalize(wo + glm::normalize(mirrored + (least - height) * geometric_normal));
}

// The direction across the normal that is nearest to the one given; x of the frame of Duff et al.
// (2017) where that is 0.
glm::dvec3 tangent_near(const glm::dvec3& direction, const glm::dvec3& n) {
  const glm::dvec3 across = direction - n * glm::dot(n, direction);
  if (glm::length(across) > 0) return glm::normalize(across);
  const double sign = std::copysign(1.0, n.z);
  return {1 - sign * n.x * n.x / (sign + n.z), -sign * n.x * n.y / (sign + n.z), -sign * n.x};
}

Vertex vertex_at(const World& world, const Hit& hit, const glm::dvec3& wo) {
  const double side = glm::dot(hit.geometric_normal, wo) < 0 ? -1 : 1;
  const Bsdf bsdf = bsdf_at(world.scene, hit, world.options.specular_roughness);
  const glm::dvec3 geometric_normal = side * hit.geometric_normal;
  glm::dvec3 normal = side * normal_at(world.scene, world.geometry, hit);
  glm::dvec3 clear_normal = side * clear_normal_at(world.scene, world.geometry, hit);
  if (is_specular(bsdf)) {
    normal = mirroring_normal(normal, geometric_normal, wo);
    clear_normal = mirroring_normal(clear_normal, geometric_normal, wo);
  }
  ShadingPoint point{geometric_normal, normal, wo, side > 0};
  point.clear_normal = clear_normal;
  if (bsdf.alpha_along > bsdf.alpha)
    point.tangent = tangent_near(anisotropy_at(world.scene, world.geometry, hit), normal);
  return {hit, bsdf, point};
}

// The share of light that comes this far along the ray: what alpha leaves of it, and panes.
glm::dvec3 light_through(const World& world, Ray ray, double distance) {
  if (!world.has_layers)
    return glm::dvec3(world.geometry.blocked(ray, distance, world.bit) ? 0 : 1);
  glm::dvec3 share(1);
  while (share != glm::dvec3(0)) {
    const auto hit = world.geometry.closest(ray, world.bit);
    if (!hit || hit->distance >= distance) break;
    const double coverage = coverage_at(world.scene, *hit);
    const Vertex vertex = vertex_at(world, *hit, -ray.direction);
    share *= 1 - coverage + coverage * straight_through(vertex.bsdf, vertex.point);
    distance -= hit->distance + 2 * hit->offset;
    ray = resumed(ray, *hit);
  }
  return share;
}

// The space that a ray crosses is the inside of a coloured solid, or clear (null).
using Medium = const scene::Material*;

Medium inside_of(const World& world, std::uint32_t instance) {
  const scene::Material& m = world.scene.materials[world.scene.instances[instance].material];
  const bool is_coloured = m.transmission > 0 && !m.thin_walled &&
                           m.attenuation_color != glm::vec3(1) &&
                           std::isfinite(m.attenuation_distance_m);
  return is_coloured ? &m : nullptr;
}

glm::dvec3 transmittance(Medium medium, double distance) {
  if (!medium) return glm::dvec3(1);
  return glm::pow(glm::dvec3(medium->attenuation_color),
                  glm::dvec3(distance / static_cast<double>(medium->attenuation_distance_m)));
}

// The medium of a segment that ends at the vertex: one that never entered a solid and ends at an
// opaque solid's inner side was inside from its start.
Medium medium_before(const World& world, Medium medium, const Vertex& vertex) {
  if (medium || vertex.point.outside) return medium;
  const Medium solid = inside_of(world, vertex.hit.instance);
  return solid && solid->alpha_mode == scene::AlphaMode::opaque ? solid : nullptr;
}

Medium medium_beyond(const World& world, Medium medium, const Vertex& vertex,
                     const glm::dvec3& direction) {
  if (vertex.bsdf.thin_walled || glm::dot(direction, vertex.point.geometric_normal) >= 0)
    return medium;
  const Medium solid = inside_of(world, vertex.hit.instance);
  if (vertex.point.outside) return solid;
  return medium == solid ? nullptr : medium;
}

// What a ray meets that shines: every lamp it crosses, then the surface or the environment behind
// them. `bsdf_pdf` 0: no light sample competes. Lamps nearer than `from` were met before. `medium`
// is known before the surface is met, `at_hit` from it.
glm::dvec3 emitted(const World& world, const Ray& ray, const std::optional<Hit>& hit,
                   double bsdf_pdf, double from, Medium medium, Medium at_hit) {
  const auto weight = [&](double light_pdf) {
    return bsdf_pdf > 0 ? power_heuristic(bsdf_pdf, light_pdf) : 1.0;
  };
  glm::dvec3 sum(0);
  for (const set::Light& lamp : world.lamps) {
    const auto met = meet_lamp(lamp, ray);
    if (met && met->distance > from && (!hit || met->distance < hit->distance))
      sum += weight(met->pdf) * met->radiance * transmittance(medium, met->distance);
  }
  if (!hit) {
    return sum + weight(world.environment.pdf(ray.direction)) *
                     world.environment.radiance(ray.direction) * transmittance(medium, infinity);
  }
  const glm::dvec3 emission = emission_at(world.scene, *hit);
  if (emission == glm::dvec3(0)) return sum;
  const double cosine = std::abs(glm::dot(hit->geometric_normal, ray.direction));
  const double pdf = world.emissive.area_pdf(hit->instance, hit->triangle) * hit->distance *
                     hit->distance / cosine;
  return sum + weight(pdf) * emission * transmittance(at_hit, hit->distance);
}

// f cos / pdf, weighted against finding the same direction by the BSDF; `light_pdf` 0: a light no
// other technique finds.
glm::dvec3 reflected(const Vertex& vertex, const glm::dvec3& wi, double light_pdf) {
  const double mis =
      light_pdf > 0 ? power_heuristic(light_pdf, pdf(vertex.bsdf, vertex.point, wi)) : 1;
  return mis * evaluate(vertex.bsdf, vertex.point, wi);
}

glm::dvec3 light_from_meshes(const World& world, const Vertex& vertex, Medium medium,
                             Random& random) {
  const EmissiveMeshes::Sample s = world.emissive.sample(random);
  if (s.area_pdf <= 0) return glm::dvec3(0);
  const glm::dvec3 towards = s.position - vertex.hit.position;
  const glm::dvec3 start =
      vertex.start(scatters_behind(vertex.bsdf) ? towards : vertex.point.geometric_normal);
  const glm::dvec3 to_light = s.position - start;
  const double distance = glm::length(to_light);
  const glm::dvec3 wi = to_light / distance;
  const double cosine = std::abs(glm::dot(s.normal, wi));
  if (cosine <= 0) return glm::dvec3(0);
  const double light_pdf = s.area_pdf * distance * distance / cosine;
  const glm::dvec3 f = reflected(vertex, wi, light_pdf);
  const double margin = 0x1p-18 * std::max(glm::length(s.position), distance) / cosine;
  if (f == glm::dvec3(0)) return f;
  const double coverage = coverage_at(world.scene, s);
  return f * coverage * emission_at(world.scene, s) / light_pdf *
         transmittance(medium_beyond(world, medium, vertex, wi), distance) *
         light_through(world, {start, wi}, distance - margin);
}

// Next-event estimation: one sample of the environment, of every lamp and of the emissive meshes.
glm::dvec3 direct_light(const World& world, const Vertex& vertex, Medium medium, Random& random) {
  const glm::dvec3 above = vertex.start(vertex.point.geometric_normal);
  const bool behind = scatters_behind(vertex.bsdf);
  glm::dvec3 sum(0);
  const auto add = [&](const glm::dvec3& wi, double distance, double light_pdf,
                       const glm::dvec3& value) {
    const glm::dvec3 f = reflected(vertex, wi, light_pdf) * value;
    if (f == glm::dvec3(0)) return;
    sum += f * transmittance(medium_beyond(world, medium, vertex, wi), distance) *
           light_through(world, {behind ? vertex.start(wi) : above, wi}, distance);
  };
  if (!world.environment.black()) {
    const DirectionSample s = world.environment.sample(random.uniform2());
    add(s.direction, infinity, s.pdf, world.environment.radiance(s.direction) / s.pdf);
  }
  for (const set::Light& lamp : world.lamps) {
    const LightSample s = sample_lamp(lamp, behind ? vertex.hit.position : above, random);
    add(s.direction, s.distance, s.pdf, s.value);
  }
  if (!world.emissive.empty()) sum += light_from_meshes(world, vertex, medium, random);
  return sum;
}

glm::dvec3 radiance(const World& world, Ray ray, Random& random, double& first_distance) {
  glm::dvec3 sum(0);
  glm::dvec3 throughput(1);
  double bsdf_pdf = 0;
  bool last_dirac = false;
  bool has_rough_vertex = false;
  Medium medium = nullptr;
  std::optional<Hit> passed;  // the last pane on this ray
  first_distance = -1;
  for (int depth = 0;;) {
    const auto hit = closest_met(world.scene, world.geometry, ray, world.bit, random, passed);
    if (first_distance < 0) first_distance = hit ? hit->distance : 0;
    std::optional<Vertex> met;
    if (hit) met.emplace(vertex_at(world, *hit, -ray.direction));
    const Medium at_hit = met ? medium_before(world, medium, *met) : medium;
    const bool caustic = has_rough_vertex && last_dirac;
    if (world.options.caustics || !caustic) {
      sum += throughput *
             emitted(world, ray, hit, bsdf_pdf, passed ? passed->distance : 0, medium, at_hit);
    }
    if (!hit) return sum;

    const Vertex& vertex = *met;
    const bool ends = depth == world.options.max_depth;
    const bool is_pane = straight_through(vertex.bsdf, vertex.point) != glm::dvec3(0);
    if (ends && !is_pane) return sum;
    const glm::dvec3 arriving = throughput * transmittance(at_hit, hit->distance);
    if (!ends && !only_dirac(vertex.bsdf))
      sum += arriving * direct_light(world, vertex, at_hit, random);

    const auto next = sample(vertex.bsdf, vertex.point, random);
    if (!next) return sum;
    // To go straight through a pane is no event: the ray, and what competes with it, stay as they
    // are.
    if (is_pane && next->dirac && next->wi == -vertex.point.wo) {
      throughput *= next->weight;
      passed = hit;
      continue;
    }
    if (ends) return sum;
    throughput = arriving * next->weight;
    passed.reset();
    ++depth;
    bsdf_pdf = next->pdf;
    last_dirac = next->dirac;
    has_rough_vertex = has_rough_vertex || !next->dirac;
    if (depth >= roulette_depth) {
      const double survival = std::min(1.0, largest(throughput));
      if (random.uniform() >= survival) return sum;
      throughput /= survival;
    }
    medium = medium_beyond(world, at_hit, vertex, next->wi);
    ray = {vertex.start(next->wi), next->wi};
  }
}

// Whether the first thing that the ray meets in either world is in one of them only. It passes a
// pane by the odds of the least channel that the pane lets through.
bool is_covered(const World& world, const Ray& ray, Random& random) {
  std::optional<Hit> hit;
  for (;;) {
    hit = closest_met(world.scene, world.geometry, ray, scene::world_both, random, hit);
    if (!hit) return false;
    const Vertex vertex = vertex_at(world, *hit, -ray.direction);
    const glm::dvec3 through = straight_through(vertex.bsdf, vertex.point);
    if (random.uniform() >= std::min({through.x, through.y, through.z})) break;
  }
  return world.scene.instances[hit->instance].presence != scene::world_both;
}

struct PixelSums {
  glm::dvec3 sum{0}, squares{0};
  double mask = 0, depth = 0;
  int hits = 0;
};

}  // namespace

struct CpuTracer::Impl {
  Impl(const scene::Scene& traced, const lighting::EnvironmentMap& map, const TraceOptions& how)
      : scene(traced), environment(map), options(how), geometry(traced) {
    has_layers = std::any_of(scene.materials.begin(), scene.materials.end(), [](const auto& m) {
      return m.alpha_mode != scene::AlphaMode::opaque || (m.thin_walled && m.transmission > 0);
    });
  }

  const scene::Scene& scene;
  Environment environment;
  TraceOptions options;
  Geometry geometry;
  bool has_layers = false;
};

CpuTracer::CpuTracer(const scene::Scene& scene, const lighting::EnvironmentMap& environment,
                     const TraceOptions& options) {
  impl_ = std::make_unique<Impl>(scene, environment, options);
}

CpuTracer::~CpuTracer() = default;

TracedPicture CpuTracer::trace(const ObserverCalibration& calibration,
                               const glm::dmat4& world_from_camera, std::uint32_t world_bit,
                               int samples, std::uint64_t seed) {
  const int width = calibration.intrinsics.width, height = calibration.intrinsics.height;
  const glm::dvec3 eye(world_from_camera[3]);
  const glm::dmat3 rotation(world_from_camera);
  impl_->geometry.place(eye);
  const World world{impl_->scene,
                    impl_->environment,
                    impl_->geometry,
                    impl_->options,
                    world_bit,
                    placed_lamps(impl_->scene, eye, world_bit),
                    EmissiveMeshes(impl_->scene, impl_->geometry, world_bit),
                    impl_->has_layers};

  const auto pixel = [&](int x, int y) {
    Random random(seed, (static_cast<std::uint64_t>(y) << 32) | static_cast<std::uint32_t>(x));
    PixelSums sums;
    for (int s = 0; s < samples; ++s) {
      const glm::dvec2 jitter = random.uniform2() - 0.5;
      const Ray in_camera = camera_ray(calibration, x + jitter.x, y + jitter.y, random);
      const Ray ray{rotation * in_camera.origin, glm::normalize(rotation * in_camera.direction)};
      double distance = 0;
      const glm::dvec3 value = radiance(world, ray, random, distance);
      if (!std::isfinite(value.x + value.y + value.z)) {
        throw Error("reference tracer: radiance is not finite at pixel (" + std::to_string(x) +
                    ", " + std::to_string(y) + ")");
      }
      sums.sum += value;
      sums.squares += value * value;
      if (distance > 0) {
        sums.depth += distance * in_camera.direction.z;
        ++sums.hits;
      }
      if (is_covered(world, ray, random)) ++sums.mask;
    }
    return sums;
  };

  TracedPicture out;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  out.mean.resize(pixels);
  out.standard_error.resize(pixels);
  out.mask.resize(pixels);
  out.depth.resize(pixels);
  std::atomic<int> next_row{0};
  const auto work = [&] {
    for (int row = next_row++; row < height; row = next_row++) {
      for (int column = 0; column < width; ++column) {
        const PixelSums p = pixel(column, row);
        const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                       static_cast<std::size_t>(column);
        const double n = samples;
        out.mean[i] = p.sum / n;
        const glm::dvec3 variance =
            glm::max(p.squares / n - out.mean[i] * out.mean[i], glm::dvec3(0));
        out.standard_error[i] = glm::sqrt(variance / std::max(n - 1, 1.0));
        out.mask[i] = p.mask / n;
        out.depth[i] = p.hits > 0 ? p.depth / p.hits : 0;
      }
    }
  };
  auto second = std::async(std::launch::async, work);
  work();
  second.get();
  return out;
}

}  // namespace previz::truth
