#include "daemon/core/render/picture/error_estimate.hpp"

#include <algorithm>
#include <cmath>

#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

constexpr int block = static_cast<int>(gpu::SAMPLED_BLOCK);
constexpr std::size_t parts_of_block = gpu::SAMPLED_PARTS;

int blocks_in(int pixels) {
  return (pixels + block - 1) / block;
}

// Returns a channel's variance after clipping at white: only the part of the standard error that
// reaches below white counts, and at most white itself.
double seen_variance(double mean, double variance, double white) {
  if (mean <= white) return std::min(variance, white * white);
  const double below = std::clamp(std::sqrt(variance) - (mean - white), 0.0, white);
  return below * below;
}

struct Grid {
  int columns, rows;

  std::size_t size() const { return static_cast<std::size_t>(columns) * rows; }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y) * columns + x; }
  void each_neighbour(std::size_t cell, const auto& visit) const {
    const int x = static_cast<int>(cell) % columns, y = static_cast<int>(cell) / columns;
    for (int v = std::max(y - 1, 0); v <= std::min(y + 1, rows - 1); ++v)
      for (int u = std::max(x - 1, 0); u <= std::min(x + 1, columns - 1); ++u) visit(at(u, v));
  }
};

Grid grid_of(int width, int height) {
  return {blocks_in(width), blocks_in(height)};
}

// Returns the mean over a block and its neighbours of what `squared_error` returns for each; the
// block itself counts half.
double smoothed(const Grid& grid, std::size_t cell, const auto& squared_error) {
  constexpr double own_weight = 8;
  double sum = 0, weights = 0;
  grid.each_neighbour(cell, [&](std::size_t other) {
    const double weight = other == cell ? own_weight : 1;
    sum += weight * squared_error(other);
    weights += weight;
  });
  return sum / weights;
}

// Returns each block's standard error, smoothed over its neighbours.
std::vector<double> smoothed(const ErrorEstimate& estimate, const Grid& grid) {
  const auto squared_error = [&](std::size_t cell) {
    return 1.0 * estimate.blocks[cell] * estimate.blocks[cell];
  };
  std::vector<double> result;
  for (std::size_t cell = 0; cell < grid.size(); ++cell)
    result.push_back(std::sqrt(smoothed(grid, cell, squared_error)));
  return result;
}

}  // namespace

ErrorEstimate estimate_error(const Layers& layers) {
  const Grid grid = grid_of(layers.width, layers.height);
  std::vector<double> variance(grid.size()), pixels(grid.size());
  std::vector<double> part_variance(parts_of_block * grid.size()),
      part_pixels(parts_of_block * grid.size());
  double square = 0;
  for (int y = 0; y < layers.height; ++y) {
    for (int x = 0; x < layers.width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * layers.width + x;
      const std::size_t cell = grid.at(x / block, y / block);
      const std::size_t part = parts_of_block * cell + static_cast<std::size_t>(y % 2 * 2 + x % 2);
      for (int c = 0; c < 3; ++c) {
        const double mean = layers.composite[pixel][c];
        const double noise = seen_variance(mean, layers.variance[pixel][c], layers.white);
        variance[cell] += noise;
        part_variance[part] += noise;
        const double seen = std::min(mean, layers.white);
        square += seen * seen;
      }
      pixels[cell] += 1;
      part_pixels[part] += 1;
    }
  }
  ErrorEstimate estimate;
  estimate.blocks.resize(variance.size());
  estimate.parts.resize(part_variance.size());
  if (!(square > 0)) return estimate;
  const double mean_square = square / static_cast<double>(layers.composite.size());
  double total = 0;
  for (std::size_t i = 0; i < variance.size(); ++i) {
    total += variance[i];
    estimate.blocks[i] = static_cast<float>(std::sqrt(variance[i] / pixels[i] / mean_square));
  }
  // Some parts of blocks that the picture's edge cuts have no pixel.
  for (std::size_t i = 0; i < part_variance.size(); ++i)
    if (part_pixels[i] > 0)
      estimate.parts[i] =
          static_cast<float>(std::sqrt(part_variance[i] / part_pixels[i] / mean_square));
  estimate.picture = std::sqrt(total / square);
  return estimate;
}

std::vector<bool> parts_above(const ErrorEstimate& estimate, int width, int height, double error,
                              const std::vector<std::uint32_t>& samples) {
  const Grid grid = grid_of(width, height);
  std::vector<bool> result(parts_of_block * grid.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    const double left = smoothed(grid, i / parts_of_block, [&](std::size_t cell) {
      const std::size_t judge = parts_of_block * cell + (i + 1) % parts_of_block;
      return 1.0 * estimate.parts[judge] * estimate.parts[judge] * samples[judge] / samples[i];
    });
    result[i] = left > error * error;
  }
  return result;
}

std::vector<std::uint32_t> spread_samples(const ErrorEstimate& estimate, int width, int height,
                                          int samples) {
  constexpr double least_share = 1.0 / 8, most_share = 8;
  constexpr int halvings = 60;  // bisections, which exhaust the precision of a double
  constexpr double no_error = 1e-12;
  const Grid grid = grid_of(width, height);
  const std::vector<double> error = smoothed(estimate, grid);
  const auto share = [&](std::size_t cell, double gain) {
    return std::clamp(gain * error[cell], least_share, most_share);
  };
  const auto mean_share = [&](double gain) {
    double sum = 0;
    for (std::size_t cell = 0; cell < grid.size(); ++cell) sum += share(cell, gain);
    return sum / static_cast<double>(grid.size());
  };
  if (*std::ranges::max_element(error) < no_error)
    return std::vector<std::uint32_t>(grid.size(), static_cast<std::uint32_t>(samples));
  // Blocks at a bound leave more, or fewer, samples to the others, so the common factor is found by
  // bisection.
  double low = 0, high = most_share / no_error;
  for (int i = 0; i < halvings; ++i)
    (mean_share((low + high) / 2) < 1 ? low : high) = (low + high) / 2;
  std::vector<std::uint32_t> limits;
  for (std::size_t cell = 0; cell < grid.size(); ++cell)
    limits.push_back(
        static_cast<std::uint32_t>(std::lround(std::max(samples * share(cell, low), 1.0))));
  return limits;
}

}  // namespace previz::render
