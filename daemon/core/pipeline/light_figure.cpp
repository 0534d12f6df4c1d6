#include "daemon/core/pipeline/light_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/median.hpp"

namespace previz::pipeline {
namespace {

constexpr int tiles_a_side = 4;
constexpr double least_share_of_tile = 0.05;  // of its pixels
constexpr std::size_t least_tiles = 3;
constexpr double median_over_mean = 1.2533;  // of standard errors (Gaussian): sqrt(pi / 2)
constexpr double sigma_over_mad = 1.4826;

// What the pixels of a tile have together, so that the noise of single ones evens out.
struct Tile {
  glm::dvec3 model{0}, picture{0};
  std::size_t pixels = 0;
};

// "1.1 1.6 1.9"
std::string factors(const LightFigure& figure) {
  std::string all;
  for (glm::length_t c = 0; c < 3; ++c) {
    const double ratio = figure.ratio[c];
    add_to_list(all, ratio < 10 ? fmt::format("{:.2g}", ratio) : fmt::format("{:.0f}", ratio), " ");
  }
  return all;
}

}  // namespace

void LightComparison::add(const render::Layers& layers, const Plate& plate,
                          const lighting::Response& response) {
  const std::uint32_t clipped = response.clipping().from;
  std::array<Tile, static_cast<std::size_t>(tiles_a_side) * tiles_a_side> tiles;
  for (int y = 0; y < layers.height; ++y)
    for (int x = 0; x < layers.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(layers.width) +
                            static_cast<std::size_t>(x);
      if (layers.mask[i] > 0 || !(layers.depth[i] > 0)) continue;
      glm::dvec3 signal;
      bool is_seen = true;
      for (glm::length_t c = 0; c < 3; ++c) {
        const std::uint16_t code = plate.samples[3 * i + static_cast<std::size_t>(c)];
        is_seen = is_seen && code > 0 && code < clipped;
        signal[c] = response.inverse()[code] * layers.white;
      }
      const glm::dvec3 model(layers.real[i]);
      const glm::dvec3 rounding = 1e-6 * signal;
      const bool is_measured = glm::all(glm::lessThan(glm::abs(model - signal), rounding));
      if (!is_seen || is_measured) continue;
      Tile& tile = tiles[static_cast<std::size_t>(y * tiles_a_side / layers.height * tiles_a_side +
                                                  x * tiles_a_side / layers.width)];
      tile.model += model;
      tile.picture += signal;
      ++tile.pixels;
    }
  const double pixels = static_cast<double>(layers.width) * layers.height / tiles.size();
  for (const Tile& tile : tiles) {
    if (static_cast<double>(tile.pixels) < least_share_of_tile * pixels) continue;
    if (!(std::min({tile.model.r, tile.model.g, tile.model.b}) > 0)) continue;
    logs_.emplace_back(std::log(tile.model.r / tile.picture.r),
                       std::log(tile.model.g / tile.picture.g),
                       std::log(tile.model.b / tile.picture.b));
  }
}

std::optional<LightFigure> LightComparison::figure() const {
  if (logs_.size() < least_tiles) return std::nullopt;
  LightFigure figure;
  figure.tiles = logs_.size();
  for (glm::length_t c = 0; c < 3; ++c) {
    std::vector<double> logs, off;
    for (const glm::dvec3& log : logs_) logs.push_back(log[c]);
    const double middle = median(logs);
    for (const double log : logs) off.push_back(std::abs(log - middle));
    figure.ratio[c] = std::exp(middle);
    figure.sigma[c] = median_over_mean * sigma_over_mad * median(std::move(off)) /
                      std::sqrt(static_cast<double>(logs.size()));
  }
  return figure;
}

std::string light_remark(const LightFigure& figure) {
  bool is_off = false;
  for (glm::length_t c = 0; c < 3; ++c) {
    const double log = std::abs(std::log(figure.ratio[c]));
    is_off = is_off || (log > light_off_stops * std::log(2.0) && log > 3 * figure.sigma[c]);
  }
  if (!is_off) return {};
  return fmt::format(
      "the model under this light is {} times as bright as the picture (red, green, blue), and "
      "shadows and virtual objects are as far off: previz calibrate balance measures the factors",
      factors(figure));
}

std::string light_notice(const LightFigure& figure) {
  return factors(figure) + " times the picture: calibrate balance";
}

}  // namespace previz::pipeline
