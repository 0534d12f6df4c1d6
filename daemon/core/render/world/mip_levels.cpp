#include "daemon/core/render/world/mip_levels.hpp"

#include <algorithm>
#include <cstddef>

namespace previz::render {
namespace {

// The texels [first, first + weights.size()) of a row, with their shares of a wider texel.
struct Covered {
  std::size_t first = 0;
  std::vector<double> weights;
};

// Returns what each of `to` texels covers of `from`, at most three for a half rounded down.
std::vector<Covered> coverage_of(int from, int to) {
  std::vector<Covered> result;
  for (int i = 0; i < to; ++i) {
    // Lengths are integers: texel j covers [j, j + 1] * to, the wider one [i, i + 1] * from.
    const int low = i * from / to, high = ((i + 1) * from + to - 1) / to;
    Covered covered{static_cast<std::size_t>(low), {}};
    for (int j = low; j < high; ++j) {
      const int begin = std::max(j * to, i * from), end = std::min((j + 1) * to, (i + 1) * from);
      covered.weights.push_back(static_cast<double>(end - begin) / from);
    }
    result.push_back(std::move(covered));
  }
  return result;
}

MipLevel halved(int width, int height, const std::vector<glm::vec4>& texels) {
  MipLevel level{std::max(width / 2, 1), std::max(height / 2, 1), {}};
  const std::vector<Covered> columns = coverage_of(width, level.width);
  const std::vector<Covered> rows = coverage_of(height, level.height);
  level.texels.reserve(static_cast<std::size_t>(level.width) *
                       static_cast<std::size_t>(level.height));
  for (const Covered& row : rows) {
    for (const Covered& column : columns) {
      glm::dvec4 sum(0);
      for (std::size_t y = 0; y < row.weights.size(); ++y) {
        const std::size_t first = (row.first + y) * static_cast<std::size_t>(width) + column.first;
        for (std::size_t x = 0; x < column.weights.size(); ++x)
          sum += row.weights[y] * column.weights[x] * glm::dvec4(texels[first + x]);
      }
      level.texels.emplace_back(sum);
    }
  }
  return level;
}

}  // namespace

std::vector<MipLevel> mip_levels(const scene::Texture& texture) {
  std::vector<MipLevel> levels;
  if (texture.nearest) return levels;
  int width = texture.width, height = texture.height;
  while (width > 1 || height > 1) {
    levels.push_back(halved(width, height, levels.empty() ? texture.texels : levels.back().texels));
    width = levels.back().width;
    height = levels.back().height;
  }
  return levels;
}

}  // namespace previz::render
