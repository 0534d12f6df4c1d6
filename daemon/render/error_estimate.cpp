#include "daemon/render/error_estimate.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

constexpr int block = static_cast<int>(gpu::SAMPLED_BLOCK);

int blocks_in(int pixels) {
  return (pixels + block - 1) / block;
}

}  // namespace

ErrorEstimate estimate_error(const Layers& layers) {
  const int columns = blocks_in(layers.width);
  const std::size_t count = static_cast<std::size_t>(columns) * blocks_in(layers.height);
  std::vector<double> variance(count), pixels(count);
  double square = 0;
  for (int y = 0; y < layers.height; ++y) {
    for (int x = 0; x < layers.width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * layers.width + x;
      const std::size_t at = static_cast<std::size_t>(y / block) * columns + x / block;
      const glm::dvec3 v(layers.variance[pixel]);
      variance[at] += v.r + v.g + v.b;
      pixels[at] += 1;
      const glm::dvec3 radiance(layers.composite[pixel]);
      square += glm::dot(radiance, radiance);
    }
  }
  ErrorEstimate estimate;
  estimate.blocks.resize(count);
  if (!(square > 0)) return estimate;
  const double mean_square = square / static_cast<double>(layers.composite.size());
  double total = 0;
  for (std::size_t i = 0; i < count; ++i) {
    total += variance[i];
    estimate.blocks[i] = static_cast<float>(std::sqrt(variance[i] / pixels[i] / mean_square));
  }
  estimate.picture = std::sqrt(total / square);
  return estimate;
}

std::vector<std::uint32_t> blocks_above(const ErrorEstimate& estimate, int width, int height,
                                        double error) {
  const int columns = blocks_in(width), rows = blocks_in(height);
  std::vector<std::uint32_t> result(estimate.blocks.size());
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      if (estimate.blocks[static_cast<std::size_t>(y) * columns + x] <= error) continue;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, rows - 1); ++v)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, columns - 1); ++u)
          result[static_cast<std::size_t>(v) * columns + u] = 1;
    }
  }
  return result;
}

}  // namespace previz::render
