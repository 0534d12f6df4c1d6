#include "daemon/core/render/world/emission_weights.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace previz::render {
namespace {

constexpr int most_points_a_side = 8;
// No triangle weighs less than this share of its mesh's mean, nor than this share of what it would
// send without texture and alpha.
constexpr double least_of_mean = 0.1, least_weight = 1e-4;
constexpr float furthest_uv = 65536;  // beyond it single precision cannot resolve texels

int texel_index(float at, int size, scene::Wrap wrap) {
  if (!(std::abs(at) < furthest_uv * static_cast<float>(size))) at = 0;
  const auto i = static_cast<int>(std::floor(at));
  if (wrap == scene::Wrap::clamp) return std::clamp(i, 0, size - 1);
  const int period = wrap == scene::Wrap::mirror ? 2 * size : size;
  const int rest = (i % period + period) % period;
  return rest < size ? rest : period - 1 - rest;
}

glm::vec4 texel_at(const scene::Texture& texture, const glm::vec2& uv) {
  const int x =
      texel_index(uv.x * static_cast<float>(texture.width), texture.width, texture.wrap_u);
  const int y =
      texel_index(uv.y * static_cast<float>(texture.height), texture.height, texture.wrap_v);
  return texture.texels[static_cast<std::size_t>(y) * static_cast<std::size_t>(texture.width) +
                        static_cast<std::size_t>(x)];
}

const scene::Texture* texture_of(const scene::Scene& scene, std::uint32_t index) {
  return index == scene::no_texture ? nullptr : &scene.textures[index];
}

struct Glow {
  const scene::Material* material;
  const scene::Texture* emission;  // may be null
  const scene::Texture* alpha;     // may be null

  double coverage(const glm::vec2& uv) const {
    if (material->alpha_mode == scene::AlphaMode::opaque) return 1;
    const float value = material->alpha * (alpha ? texel_at(*alpha, uv).a : 1.0f);
    if (material->alpha_mode == scene::AlphaMode::mask) return value >= material->alpha_cutoff;
    return std::clamp(value, 0.0f, 1.0f);
  }
  double at(const glm::vec2& uv) const {
    const glm::vec3& e = material->emission;
    const glm::vec3 sent = emission ? e * glm::vec3(texel_at(*emission, uv)) : e;
    return coverage(uv) * (sent.r + sent.g + sent.b) / (e.r + e.g + e.b);
  }
};

// Returns as many points a side as the longest side has texels.
int points_a_side(const Glow& glow, const glm::vec2& u, const glm::vec2& v) {
  float longest = 1;
  for (const scene::Texture* texture : {glow.emission, glow.alpha}) {
    if (!texture) continue;
    const glm::vec2 size(texture->width, texture->height);
    for (const glm::vec2& side : {u, v, v - u})
      longest = std::max(longest, glm::length(side * size));
  }
  return static_cast<int>(std::ceil(std::min(longest, static_cast<float>(most_points_a_side))));
}

// The points are the centres of n^2 equal triangles that make up the whole one.
double mean_over(const Glow& glow, const glm::vec2& uv, const glm::vec2& u, const glm::vec2& v) {
  const int n = points_a_side(glow, u, v);
  const auto at = [&](float a, float b) {
    return glow.at(uv + (a * u + b * v) / static_cast<float>(n));
  };
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      const auto a = static_cast<float>(i), b = static_cast<float>(j);
      sum += at(a + 1.0f / 3, b + 1.0f / 3);
      if (i + j + 1 < n) sum += at(a + 2.0f / 3, b + 2.0f / 3);
    }
  }
  return sum / (n * n);
}

}  // namespace

std::vector<double> emission_weights(const scene::Scene& scene, const scene::Instance& instance) {
  const scene::Material& material = scene.materials[instance.material];
  // Weights need not be exact: alpha counts where it is mapped as the emission is.
  const std::size_t mapping = scene::mapping_of(material, &scene::Material::emission_texture);
  const bool has_alpha = material.alpha_mode != scene::AlphaMode::opaque && mapping == 0;
  const Glow glow{&material, texture_of(scene, material.emission_texture),
                  has_alpha ? texture_of(scene, material.base_color_texture) : nullptr};
  const bool is_even = !glow.emission && material.alpha_mode == scene::AlphaMode::opaque;
  const scene::Mesh& mesh = scene.meshes[instance.mesh];
  if (is_even || !scene::emits(material) || mesh.triangles.empty()) return {};
  const std::vector<glm::vec2>& uvs = scene::uvs_of(mesh, mapping);
  std::vector<double> weights;
  weights.reserve(mesh.triangles.size());
  for (const glm::uvec3& triangle : mesh.triangles) {
    const auto uv = [&](std::uint32_t vertex) { return uvs.empty() ? glm::vec2(0) : uvs[vertex]; };
    const glm::vec2 first = uv(triangle.x);
    weights.push_back(mean_over(glow, first, uv(triangle.y) - first, uv(triangle.z) - first));
  }
  double sum = 0;
  for (const double weight : weights) sum += weight;
  const double least =
      std::max(least_of_mean * sum / static_cast<double>(weights.size()), least_weight);
  for (double& weight : weights) weight = std::max(weight, least);
  return weights;
}

}  // namespace previz::render
