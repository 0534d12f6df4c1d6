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

const scene::Mesh& mesh_of(const scene::Scene& scene, const MeshPoint& point) {
  return scene.meshes[scene.instances[point.instance].mesh];
}
const scene::Material& material_of(const scene::Scene& scene, const MeshPoint& point) {
  return scene.materials[scene.instances[point.instance].material];
}

template <typename Value>
auto interpolated(const scene::Mesh& mesh, const MeshPoint& point,
                  const std::vector<Value>& of_vertices) {
  using Result = glm::vec<Value::length(), double>;
  Result sum(0);
  for (int i = 0; i < 3; ++i)
    sum += point.weights[i] * Result(of_vertices[mesh.triangles[point.triangle][i]]);
  return sum;
}

// One of the material's textures at a point, by its own mapping.
glm::dvec4 texel_at(const scene::Scene& scene, const MeshPoint& point,
                    std::uint32_t scene::Material::*texture) {
  const scene::Material& m = material_of(scene, point);
  const scene::Mesh& mesh = mesh_of(scene, point);
  const std::vector<glm::vec2>& uvs = scene::uvs_of(mesh, scene::mapping_of(m, texture));
  return look_up(scene, m.*texture, uvs.empty() ? glm::dvec2(0) : interpolated(mesh, point, uvs));
}

glm::dvec4 vertex_color(const scene::Scene& scene, const MeshPoint& point) {
  const scene::Mesh& mesh = mesh_of(scene, point);
  return mesh.colors.empty() ? glm::dvec4(1) : interpolated(mesh, point, mesh.colors);
}

// The strength of the material's anisotropy and its direction on the texture.
struct Anisotropy {
  double strength = 0;
  glm::dvec2 direction{1, 0};
};

Anisotropy anisotropy_of(const scene::Scene& scene, const MeshPoint& point) {
  const scene::Material& m = material_of(scene, point);
  if (m.anisotropy <= 0 || m.transmission > 0) return {};
  const double c = std::cos(m.anisotropy_rotation_rad), s = std::sin(m.anisotropy_rotation_rad);
  const glm::dmat2 turn(c, s, -s, c);
  if (m.anisotropy_texture == scene::no_texture) return {m.anisotropy, turn * glm::dvec2(1, 0)};
  const glm::dvec4 texel = texel_at(scene, point, &scene::Material::anisotropy_texture);
  const glm::dvec2 along = 2.0 * glm::dvec2(texel) - 1.0;
  return {m.anisotropy * texel.z,
          turn * (glm::length(along) > 0 ? glm::normalize(along) : glm::dvec2(1, 0))};
}

}  // namespace

Bsdf bsdf_at(const scene::Scene& scene, const MeshPoint& point, double specular_roughness) {
  using scene::Material;
  const Material& m = material_of(scene, point);
  const auto texel = [&](std::uint32_t Material::*texture) {
    return texel_at(scene, point, texture);
  };
  const glm::dvec4 metallic_roughness = texel(&Material::metallic_roughness_texture);
  const double roughness = m.roughness * metallic_roughness.y;
  Bsdf b;
  b.base_color = glm::dvec3(m.base_color) * glm::dvec3(vertex_color(scene, point)) *
                 glm::dvec3(texel(&Material::base_color_texture));
  b.metallic = m.metallic * metallic_roughness.z;
  b.alpha = b.alpha_along = roughness * roughness;
  if (const double strength = anisotropy_of(scene, point).strength; strength > 0) {
    const double widened = strength * strength;
    b.alpha_along = std::max(1e-3, widened + (1 - widened) * b.alpha);
    b.alpha = std::max(1e-3, b.alpha);
  }
  b.smooth = b.alpha_along <= specular_roughness;
  b.specular = m.specular * texel(&Material::specular_texture).w;
  b.specular_color =
      glm::dvec3(m.specular_color) * glm::dvec3(texel(&Material::specular_color_texture));
  b.ior = m.ior;
  b.transmission = m.transmission * texel(&Material::transmission_texture).x;
  b.thin_walled = m.thin_walled;
  b.clearcoat = m.clearcoat * texel(&Material::clearcoat_texture).x;
  const double lacquer = m.clearcoat_roughness * texel(&Material::clearcoat_roughness_texture).y;
  b.clearcoat_alpha = lacquer * lacquer;
  b.smooth_clearcoat = b.clearcoat_alpha <= specular_roughness;
  b.sheen_color = glm::dvec3(m.sheen_color) * glm::dvec3(texel(&Material::sheen_color_texture));
  b.sheen_roughness =
      std::max(0.07, m.sheen_roughness * texel(&Material::sheen_roughness_texture).w);
  return b;
}

namespace {

// The directions of a texture's +X and +Y around the interpolated normal.
struct TextureAxes {
  glm::dvec3 x, y;
};

// Those that the mesh states (glTF 2.0, 3.7.2.1). A mirrored instance mirrors +Y as all else.
std::optional<TextureAxes> stated_axes(const scene::Scene& scene, const Hit& hit) {
  const scene::Mesh& mesh = mesh_of(scene, hit);
  if (mesh.tangents.empty()) return std::nullopt;
  glm::dvec4 sum(0);
  for (int i = 0; i < 3; ++i)
    sum += hit.weights[i] * glm::dvec4(mesh.tangents[mesh.triangles[hit.triangle][i]]);
  const glm::dmat3 world(scene.instances[hit.instance].world_from_object);
  const glm::dvec3 given = world * glm::dvec3(sum);
  const glm::dvec3& n = hit.shading_normal;
  const glm::dvec3 across = given - n * glm::dot(n, given);
  if (!(glm::length(across) > 0)) return std::nullopt;
  const glm::dvec3 tangent = glm::normalize(across);
  return TextureAxes{tangent, glm::cross(n, tangent) * (sum.w < 0 ? -1.0 : 1.0) *
                                  (glm::determinant(world) < 0 ? -1.0 : 1.0)};
}

std::optional<TextureAxes> texture_axes(const scene::Scene& scene, const Geometry& geometry,
                                        const Hit& hit, std::uint32_t scene::Material::*texture) {
  const scene::Mesh& mesh = mesh_of(scene, hit);
  if (const auto stated = stated_axes(scene, hit)) return stated;
  const std::vector<glm::vec2>& uvs =
      scene::uvs_of(mesh, scene::mapping_of(material_of(scene, hit), texture));
  if (uvs.empty()) return std::nullopt;
  const glm::uvec3 corner = mesh.triangles[hit.triangle];
  const glm::dvec2 uv0 = uvs[corner.x];
  const glm::dmat2 uv_of_edges(glm::dvec2(uvs[corner.y]) - uv0, glm::dvec2(uvs[corner.z]) - uv0);
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

glm::dvec3 mapped_normal(const scene::Scene& scene, const Geometry& geometry, const Hit& hit,
                         std::uint32_t scene::Material::*texture, double scale) {
  if (material_of(scene, hit).*texture == scene::no_texture) return hit.shading_normal;
  const auto axes = texture_axes(scene, geometry, hit, texture);
  if (!axes) return hit.shading_normal;
  const glm::dvec3 texel = 2.0 * glm::dvec3(texel_at(scene, hit, texture)) - 1.0;
  const glm::dvec3 mapped = glm::normalize(scale * (texel.x * axes->x + texel.y * axes->y) +
                                           texel.z * hit.shading_normal);
  // One that dips below the surface is lifted onto it.
  const double lift = std::max(0.0, 1e-3 - glm::dot(mapped, hit.geometric_normal));
  return glm::normalize(mapped + lift * hit.geometric_normal);
}

}  // namespace

glm::dvec3 anisotropy_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit) {
  const Anisotropy anisotropy = anisotropy_of(scene, hit);
  if (anisotropy.strength <= 0) return glm::dvec3(0);
  const auto axes = texture_axes(scene, geometry, hit, &scene::Material::anisotropy_texture);
  if (!axes) return glm::dvec3(0);
  return anisotropy.direction.x * axes->x + anisotropy.direction.y * axes->y;
}

glm::dvec3 normal_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit) {
  return mapped_normal(scene, geometry, hit, &scene::Material::normal_texture,
                       material_of(scene, hit).normal_scale);
}

glm::dvec3 clear_normal_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit) {
  return mapped_normal(scene, geometry, hit, &scene::Material::clearcoat_normal_texture,
                       material_of(scene, hit).clearcoat_normal_scale);
}

double coverage_at(const scene::Scene& scene, const MeshPoint& point) {
  const scene::Material& m = material_of(scene, point);
  if (m.alpha_mode == scene::AlphaMode::opaque) return 1;
  const double alpha = m.alpha * vertex_color(scene, point).w *
                       texel_at(scene, point, &scene::Material::base_color_texture).w;
  if (m.alpha_mode == scene::AlphaMode::mask) return alpha >= m.alpha_cutoff ? 1 : 0;
  return std::clamp(alpha, 0.0, 1.0);
}

glm::dvec3 emission_at(const scene::Scene& scene, const MeshPoint& point) {
  const scene::Material& m = material_of(scene, point);
  if (m.emission == glm::vec3(0)) return glm::dvec3(0);
  return glm::dvec3(m.emission) *
         glm::dvec3(texel_at(scene, point, &scene::Material::emission_texture));
}

}  // namespace previz::truth
