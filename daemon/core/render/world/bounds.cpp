#include "daemon/core/render/world/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <limits>

namespace previz::render {
namespace {

// Returns the sphere around the centre of the triangles' box: exact for a sphere, at most sqrt(3)
// times too wide. Triangles that are not finite are never traced and do not count; without any
// other triangle the radius is -1.
glm::dvec4 bounding_sphere(const scene::Mesh& mesh, const glm::dmat4& world_from_object) {
  const auto for_corners = [&](const auto& visit) {
    for (const glm::uvec3& triangle : mesh.triangles) {
      glm::dvec3 corners[3];
      bool finite = true;
      for (int i = 0; i < 3; ++i) {
        corners[i] = world_from_object * glm::dvec4(glm::dvec3(mesh.positions[triangle[i]]), 1.0);
        finite = finite && std::isfinite(corners[i].x + corners[i].y + corners[i].z);
      }
      if (!finite) continue;
      for (const glm::dvec3& corner : corners) visit(corner);
    }
  };
  glm::dvec3 low(std::numeric_limits<double>::max());
  glm::dvec3 high(std::numeric_limits<double>::lowest());
  for_corners([&](const glm::dvec3& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  });
  const glm::dvec3 centre = 0.5 * (low + high);
  double radius = -1;
  for_corners([&](const glm::dvec3& p) { radius = std::max(radius, glm::length(p - centre)); });
  return {centre, radius};
}

glm::dvec4 merged_spheres(const glm::dvec4& a, const glm::dvec4& b) {
  const glm::dvec3 between = glm::dvec3(b) - glm::dvec3(a);
  const double distance = glm::length(between);
  if (distance + b.w <= a.w) return a;
  if (distance + a.w <= b.w) return b;
  const double radius = 0.5 * (distance + a.w + b.w);
  return {glm::dvec3(a) + between * ((radius - a.w) / distance), radius};
}

// Returns an upper bound on how far the linear part stretches any vector: the root of the largest
// row sum of A^T A, which for a rotation with a uniform scale is that scale.
double stretch(const glm::dmat3& a) {
  const glm::dmat3 product = glm::transpose(a) * a;
  double largest = 0;
  for (int i = 0; i < 3; ++i)
    largest =
        std::max(largest, std::abs(product[i].x) + std::abs(product[i].y) + std::abs(product[i].z));
  return std::sqrt(largest);
}

// Returns the bound that a sphere belongs to: that of the same tag, whose paper, print and ground
// have one middle.
Bounds::iterator same_tag(Bounds& bounds, std::size_t first_tag, const glm::dvec4& sphere) {
  return std::find_if(bounds.begin() + static_cast<std::ptrdiff_t>(first_tag), bounds.end(),
                      [&](const glm::dvec4& bound) {
                        return glm::distance(glm::dvec3(bound), glm::dvec3(sphere)) <
                               0.25 * std::min(bound.w, sphere.w);
                      });
}

Bounds bounds_where(const scene::Scene& scene, const Spheres& spheres,
                    const std::function<bool(const scene::Instance&)>& wanted) {
  static constexpr std::size_t most_bounds = 16;
  Bounds bounds;
  const auto add = [&](const glm::dvec4& sphere) {
    if (bounds.size() < most_bounds)
      bounds.push_back(sphere);
    else
      bounds.back() = merged_spheres(bounds.back(), sphere);
  };
  const auto is_wanted = [&](std::size_t i) {
    return spheres[i].w >= 0 && wanted(scene.instances[i]);
  };
  for (std::size_t i = 0; i < scene.instances.size(); ++i)
    if (scene.instances[i].tag == scene::TagPart::none && is_wanted(i)) add(spheres[i]);
  const std::size_t first_tag = bounds.size();
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (scene.instances[i].tag == scene::TagPart::none || !is_wanted(i)) continue;
    const auto same = same_tag(bounds, first_tag, spheres[i]);
    if (same != bounds.end())
      *same = merged_spheres(*same, spheres[i]);
    else
      add(spheres[i]);
  }
  return bounds;
}

bool is_in_one_world(const scene::Instance& instance) {
  return instance.presence == scene::world_mixed || instance.presence == scene::world_real;
}

// A box along the axes that grows with the spheres that are added.
struct Box {
  glm::dvec3 low{std::numeric_limits<double>::max()};
  glm::dvec3 high{std::numeric_limits<double>::lowest()};

  void add(const glm::dvec4& sphere) {
    low = glm::min(low, glm::dvec3(sphere) - sphere.w);
    high = glm::max(high, glm::dvec3(sphere) + sphere.w);
  }
};

// Rounds a ratio to the nearest half octave, at most 1.
double to_half_octave(double ratio) {
  return std::exp2(std::min(std::round(std::log2(ratio) * 2), 0.0) / 2);
}

}  // namespace

Spheres bounding_spheres(const scene::Scene& scene) {
  Spheres spheres;
  for (const scene::Instance& instance : scene.instances)
    spheres.push_back(bounding_sphere(scene.meshes[instance.mesh], instance.world_from_object));
  return spheres;
}

glm::dvec4 bounding_sphere(const scene::Aabb& box, const glm::dmat4& world_from_object) {
  if (!(box.low.x <= box.high.x)) return {0, 0, 0, -1};
  const glm::dvec3 low = box.low, high = box.high;
  const glm::dvec3 centre(world_from_object * glm::dvec4(0.5 * (low + high), 1));
  double radius = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at((corner & 1 ? high : low).x, (corner & 2 ? high : low).y,
                        (corner & 4 ? high : low).z);
    radius =
        std::max(radius, glm::distance(glm::dvec3(world_from_object * glm::dvec4(at, 1)), centre));
  }
  return {centre, radius};
}

Spheres moved_spheres(const Spheres& spheres, const std::vector<scene::Instance>& before,
                      const std::vector<scene::Instance>& now) {
  Spheres moved = spheres;
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    if (spheres[i].w < 0 || now[i].world_from_object == before[i].world_from_object) continue;
    const glm::dmat4 motion = now[i].world_from_object * glm::inverse(before[i].world_from_object);
    moved[i] = motion * glm::dvec4(glm::dvec3(spheres[i]), 1);
    moved[i].w = spheres[i].w * stretch(glm::dmat3(motion));
  }
  return moved;
}

Bounds difference_bounds(const scene::Scene& scene, const Spheres& spheres) {
  return bounds_where(scene, spheres, is_in_one_world);
}

Bounds specular_bounds(const scene::Scene& scene, const Spheres& spheres, double specular_alpha) {
  std::vector<bool> dirac;
  for (const scene::Material& material : scene.materials)
    dirac.push_back(scene::can_be_dirac(scene, material, specular_alpha));
  return bounds_where(scene, spheres, [&](const scene::Instance& instance) -> bool {
    return dirac[instance.material];
  });
}

double lit_radius(const scene::Scene& scene, const Spheres& spheres,
                  std::span<const Shining> shining, double scene_radius) {
  bool differs = false;
  Box lit;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (spheres[i].w < 0 || !is_in_one_world(scene.instances[i])) continue;
    differs = true;
    lit.add(spheres[i]);
  }
  double power = 0, irradiance = 0;  // the latter but for a factor that all share
  for (const Shining& one : shining) {
    Box box = lit;
    box.add(one.sphere);
    const glm::dvec3 diagonal = box.high - box.low;
    power += one.power;
    irradiance += one.power / (0.25 * glm::dot(diagonal, diagonal));
  }
  const double radius = differs && power > 0 ? std::sqrt(power / irradiance) : 0;
  return radius > 0 ? scene_radius * to_half_octave(radius / scene_radius) : scene_radius;
}

}  // namespace previz::render
