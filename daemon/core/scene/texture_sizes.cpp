#include "daemon/core/scene/texture_sizes.hpp"

#include <algorithm>
#include <queue>
#include <utility>

namespace previz::scene {
namespace {

std::uint64_t texels_of(PictureSize size, bool has_levels) {
  std::uint64_t count = 0;
  for (;;) {
    count += static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height);
    if (!has_levels || (size.width == 1 && size.height == 1)) return count;
    size = {std::max(size.width / 2, 1), std::max(size.height / 2, 1)};
  }
}

}  // namespace

std::vector<PictureSize> fitted_sizes(std::vector<PictureSize> sizes, bool has_levels,
                                      std::uint64_t most_texels) {
  std::uint64_t total = 0;
  std::priority_queue<std::pair<std::uint64_t, std::size_t>> largest;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    largest.emplace(texels_of(sizes[i], has_levels), i);
    total += texels_of(sizes[i], has_levels);
  }
  while (total > most_texels) {
    const auto [texels, i] = largest.top();
    largest.pop();
    if (texels == 1) break;
    sizes[i] = {std::max(sizes[i].width / 2, 1), std::max(sizes[i].height / 2, 1)};
    const std::uint64_t left = texels_of(sizes[i], has_levels);
    largest.emplace(left, i);
    total -= texels - left;
  }
  return sizes;
}

}  // namespace previz::scene
