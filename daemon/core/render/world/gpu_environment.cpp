#include "daemon/core/render/world/gpu_environment.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <string>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

void check(const lighting::EnvironmentMap& map) {
  const auto size = static_cast<std::uint32_t>(map.size);
  if (map.size < 1 || map.size > 4096 || !std::has_single_bit(size))
    throw Error("environment map: size " + std::to_string(map.size) +
                " is not a power of two from 1 to 4096");
  if (map.radiance.size() != static_cast<std::size_t>(size) * size)
    throw Error("environment map: " + std::to_string(map.radiance.size()) + " texels for size " +
                std::to_string(map.size));
  for (const glm::vec3& texel : map.radiance)
    for (const float value : {texel.r, texel.g, texel.b})
      if (!(std::isfinite(value) && value >= 0))
        throw Error("environment map: a texel holds " + std::to_string(value));
}

// Returns the integral over each texel of the bilinearly interpolated mean channel. It is positive
// wherever the interpolation is, so sampling by it misses nothing.
std::vector<double> texel_weights(const EncodedEnvironment& e) {
  static constexpr double tent[3] = {0.125, 0.75, 0.125};
  const std::size_t stride = e.size + 2;
  std::vector<double> weights(static_cast<std::size_t>(e.size) * e.size);
  for (std::size_t j = 0; j < e.size; ++j)
    for (std::size_t i = 0; i < e.size; ++i) {
      double sum = 0;
      for (std::size_t dj = 0; dj < 3; ++dj)
        for (std::size_t di = 0; di < 3; ++di) {
          const glm::vec4& texel = e.radiance[(j + dj) * stride + i + di];
          sum += tent[di] * tent[dj] * (texel.r + texel.g + texel.b) / 3;
        }
      weights[j * e.size + i] = sum;
    }
  return weights;
}

// Halves a square of `size`^2 weights.
std::vector<double> halved(const std::vector<double>& weights, std::size_t size) {
  std::vector<double> result(weights.size() / 4);
  for (std::size_t j = 0; j < size / 2; ++j)
    for (std::size_t i = 0; i < size / 2; ++i) {
      const std::size_t at = 2 * j * size + 2 * i;
      result[j * size / 2 + i] =
          0.25 * (weights[at] + weights[at + 1] + weights[at + size] + weights[at + size + 1]);
    }
  return result;
}

std::vector<glm::vec4> quads(const std::vector<double>& weights, std::size_t size, double scale) {
  std::vector<glm::vec4> result(weights.size() / 4);
  for (std::size_t j = 0; j < size / 2; ++j)
    for (std::size_t i = 0; i < size / 2; ++i) {
      const std::size_t at = 2 * j * size + 2 * i;
      result[j * size / 2 + i] =
          glm::vec4(scale * weights[at], scale * weights[at + 1], scale * weights[at + size],
                    scale * weights[at + size + 1]);
    }
  return result;
}

// Returns EncodedEnvironment::spread of one level of the pyramid, whose texels all have the same
// solid angle.
double spread_of(const std::vector<double>& weights, double mean) {
  double information = 0;
  for (const double weight : weights) {
    const double density = weight / mean;
    if (density > 0) information += density * std::log(density);
  }
  return 2 * std::exp(-information / static_cast<double>(weights.size()));
}

// The spread is computed from at most this many texels per side, each as large as a lamp of a
// degree.
constexpr std::size_t spread_size = 256;

}  // namespace

EncodedEnvironment encode_environment(const lighting::EnvironmentMap& map) {
  check(map);
  EncodedEnvironment e;
  e.size = static_cast<std::uint32_t>(map.size);
  e.levels = static_cast<std::uint32_t>(std::countr_zero(e.size));
  e.radiance.clear();
  for (int j = -1; j <= map.size; ++j)
    for (int i = -1; i <= map.size; ++i)
      e.radiance.emplace_back(map.radiance[lighting::wrapped_texel(map.size, i, j)], 0.0f);

  std::vector<std::vector<double>> pyramid{texel_weights(e)};
  while (pyramid.back().size() > 1)
    pyramid.push_back(halved(pyramid.back(), std::size_t{1} << (e.levels + 1 - pyramid.size())));
  e.mean = pyramid.back().front();
  const auto coarse = std::ranges::find_if(
      pyramid, [](const auto& level) { return level.size() <= spread_size * spread_size; });
  if (e.mean > 0) e.spread = spread_of(*coarse, e.mean);

  // A black map is sampled uniformly.
  if (!(e.mean > 0)) {
    for (auto& level : pyramid) level.assign(level.size(), 1.0);
  }
  const double scale = e.mean > 0 ? 1 / e.mean : 1;
  glm::vec4* texel = e.radiance.data();
  for (int j = -1; j <= map.size; ++j)
    for (int i = -1; i <= map.size; ++i)
      (texel++)->a = static_cast<float>(pyramid.front()[lighting::wrapped_texel(map.size, i, j)] *
                                        scale * std::numbers::inv_pi / 4);
  for (std::uint32_t level = 0; level < e.levels; ++level) {
    const auto& children = pyramid[e.levels - 1 - level];
    const auto texels = quads(children, std::size_t{2} << level, scale);
    e.importance.insert(e.importance.end(), texels.begin(), texels.end());
  }
  return e;
}

}  // namespace previz::render
