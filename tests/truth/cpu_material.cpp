#include "tests/truth/cpu_material.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>
#include <optional>

namespace previz::truth {
namespace {

std::size_t wrapped(double index, int size, scene::Wrap wrap) {
  const auto i = static_cast<std::int64_t>(index);
  const std::int64_t n = size;
  switch (wrap) {
    case scene::Wrap::repeat:
      return static_cast<std::size_t>(((i % n) + n) % n);
    case scene::Wrap::clamp:
      return static_cast<std::size_t>(std::clamp<std::int64_t>(i, 0, n - 1));
    case scene::Wrap::mirror:
      break;
  }
  const std::int64_t folded = ((i % (2 * n)) + 2 * n) % (2 * n);
  return static_cast<std::size_t>(folded < n ? folded : 2 * n - 1 - folded);
}

// Texel (i, j) covers [i, i + 1) x [j, j + 1) of (u width, v height); v = 0 is the first row.
glm::dvec4 look_up(const scene::Scene& scene, std::uint32_t index, const glm::dvec2& uv) {
  if (index == scene::no_texture) return glm::dvec4(1);
  const scene::Texture& texture = scene.textures[index];
  const auto texel = [&](double i, double j) {
    return glm::dvec4(texture.texels[wrapped(j, texture.height, texture.wrap_v) *
                                         static_cast<std::size_t>(texture.width) +
                                     wrapped(i, texture.width, texture.wrap_u)]);
  };
  const glm::dvec2 p = uv * glm::dvec2(texture.width, texture.height);
  if (texture.nearest) return texel(std::floor(p.x), std::floor(p.y));
  const glm::dvec2 low = glm::floor(p - 0.5);
  const glm::dvec2 f = p - 0.5 - low;
  return (1 - f.y) * ((1 - f.x) * texel(low.x, low.y) + f.x * texel(low.x + 1, low.y)) +
         f.y * ((1 - f.x) * texel(low.x, low.y + 1) + f.x * texel(low.x + 1, low.y + 1));
}

}  // namespace

Bsdf bsdf_at(const scene::Scene& scene, std::uint32_t instance, const glm::dvec2& uv,
             double specular_roughness) {
  const scene::Material& m = scene.materials[scene.instances[instance].material];
  const glm::dvec4 metallic_roughness = look_up(scene, m.metallic_roughness_texture, uv);
  const double roughness = m.roughness * metallic_roughness.y;
  Bsdf b;
  b.base_color = glm::dvec3(m.base_color) * glm::dvec3(look_up(scene, m.base_color_texture, uv));
  b.metallic = m.metallic * metallic_roughness.z;
  b.alpha = b.alpha_along = roughness * roughness;
  if (m.anisotropy > 0 && m.transmission <= 0) {
    const double widened = static_cast<double>(m.anisotropy) * m.anisotropy;
    b.alpha_along = std::max(1e-3, widened + (1 - widened) * b.alpha);
    b.alpha = std::max(1e-3, b.alpha);
  }
  b.smooth = b.alpha_along <= specular_roughness;
  b.specular = m.specular;
  b.specular_color = m.specular_color;
  b.ior = m.ior;
  b.transmission = m.transmission;
  b.thin_walled = m.thin_walled;
  b.clearcoat = m.clearcoat;
  const double lacquer = m.clearcoat_roughness;
  b.clearcoat_alpha = lacquer * lacquer;
  b.smooth_clearcoat = b.clearcoat_alpha <= specular_roughness;
  b.sheen_color = m.sheen_color;
  b.sheen_roughness = std::max(0.07, static_cast<double>(m.sheen_roughness));
  return b;
}

namespace {

// The directions of a texture's +X and +Y around the interpolated normal.
struct TextureAxes {
  glm::dvec3 x, y;
};

std::optional<TextureAxes> texture_axes(const scene::Scene& scene, const Geometry& geometry,
                                        const Hit& hit) {
  const scene::Mesh& mesh = scene.meshes[scene.instances[hit.instance].mesh];
  if (mesh.uvs.empty()) return std::nullopt;
  const glm::uvec3 corner = mesh.triangles[hit.triangle];
  const glm::dvec2 uv0 = mesh.uvs[corner.x];
  const glm::dmat2 uv_of_edges(glm::dvec2(mesh.uvs[corner.y]) - uv0,
                               glm::dvec2(mesh.uvs[corner.z]) - uv0);
  if (glm::determinant(uv_of_edges) == 0) return std::nullopt;
  const glm::dmat2 edges_of_uv = glm::inverse(uv_of_edges);
  const Triangle t = geometry.triangle(hit.instance, hit.triangle);
  const auto along = [&](int axis) {
    return edges_of_uv[axis].x * (t.v1 - t.v0) + edges_of_uv[axis].y * (t.v2 - t.v0);
  };
  const glm::dvec3& n = hit.shading_normal;
  const glm::dvec3 tangent = glm::normalize(along(0) - n * glm::dot(n, along(0)));
  glm::dvec3 up = glm::cross(n, tangent);
  if (glm::dot(up, along(1)) > 0) up = -up;  // v runs down the picture
  return TextureAxes{tangent, up};
}

}  // namespace

glm::dvec3 anisotropy_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit) {
  const scene::Material& m = scene.materials[scene.instances[hit.instance].material];
  if (m.anisotropy <= 0) return glm::dvec3(0);
  const auto axes = texture_axes(scene, geometry, hit);
  if (!axes) return glm::dvec3(0);
  const double turned = m.anisotropy_rotation_rad;
  return std::cos(turned) * axes->x + std::sin(turned) * axes->y;
}

glm::dvec3 normal_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit) {
  const scene::Material& m = scene.materials[scene.instances[hit.instance].material];
  if (m.normal_texture == scene::no_texture) return hit.shading_normal;
  const auto axes = texture_axes(scene, geometry, hit);
  if (!axes) return hit.shading_normal;
  const glm::dvec3 texel = 2.0 * glm::dvec3(look_up(scene, m.normal_texture, hit.uv)) - 1.0;
  const glm::dvec3 mapped =
      glm::normalize(static_cast<double>(m.normal_scale) * (texel.x * axes->x + texel.y * axes->y) +
                     texel.z * hit.shading_normal);
  // One that dips below the surface is lifted onto it.
  const double lift = std::max(0.0, 1e-3 - glm::dot(mapped, hit.geometric_normal));
  return glm::normalize(mapped + lift * hit.geometric_normal);
}

double coverage_at(const scene::Scene& scene, std::uint32_t instance, const glm::dvec2& uv) {
  const scene::Material& m = scene.materials[scene.instances[instance].material];
  if (m.alpha_mode == scene::AlphaMode::opaque) return 1;
  const double alpha = m.alpha * look_up(scene, m.base_color_texture, uv).w;
  if (m.alpha_mode == scene::AlphaMode::mask) return alpha >= m.alpha_cutoff ? 1 : 0;
  return std::clamp(alpha, 0.0, 1.0);
}

glm::dvec3 emission_at(const scene::Scene& scene, std::uint32_t instance, const glm::dvec2& uv) {
  const scene::Material& m = scene.materials[scene.instances[instance].material];
  if (m.emission == glm::vec3(0)) return glm::dvec3(0);
  return glm::dvec3(m.emission) * glm::dvec3(look_up(scene, m.emission_texture, uv));
}

}  // namespace previz::truth
