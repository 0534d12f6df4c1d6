#include "daemon/scene/texture_sizes.hpp"

#include <algorithm>
#include <queue>
#include <utility>

namespace previz::scene {
namespace {

constexpr double least_cover = 1e-6;  // what a texel counts of alpha 0

std::uint64_t texels_of(PictureSize size, bool has_levels) {
  std::uint64_t count = 0;
  for (;;) {
    count += static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height);
    if (!has_levels || (size.width == 1 && size.height == 1)) return count;
    size = {std::max(size.width / 2, 1), std::max(size.height / 2, 1)};
  }
}

// How much of source texel i of `from` lies in target texel `first` of `to`, and in the next, as
// fractions of a target texel.
struct Overlap {
  std::size_t first;
  double in_first, in_next;
};
Overlap overlap(int i, int from, int to) {
  const std::int64_t start = static_cast<std::int64_t>(i) * to;
  const std::int64_t first = start / from;
  const std::int64_t in_first = std::min<std::int64_t>((first + 1) * from - start, to);
  return {static_cast<std::size_t>(first), static_cast<double>(in_first) / from,
          static_cast<double>(to - in_first) / from};
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

AreaAverage::AreaAverage(PictureSize from, PictureSize to, bool by_alpha)
    : from_(from),
      to_(to),
      by_alpha_(by_alpha),
      narrow_(static_cast<std::size_t>(to.width)),
      unfinished_(static_cast<std::size_t>(to.width)) {
  texels_.reserve(static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
}

void AreaAverage::finish_row() {
  if (by_alpha_)
    for (glm::dvec4& sum : unfinished_)
      sum = glm::dvec4(glm::dvec3(sum) / (sum.a + least_cover), sum.a);
  texels_.insert(texels_.end(), unfinished_.begin(), unfinished_.end());
  std::ranges::fill(unfinished_, glm::dvec4(0));
}

void AreaAverage::add(std::span<const glm::vec4> row) {
  std::ranges::fill(narrow_, glm::dvec4(0));
  for (int x = 0; x < from_.width; ++x) {
    const Overlap at = overlap(x, from_.width, to_.width);
    glm::dvec4 texel(row[static_cast<std::size_t>(x)]);
    if (by_alpha_) texel = glm::dvec4((texel.a + least_cover) * glm::dvec3(texel), texel.a);
    narrow_[at.first] += at.in_first * texel;
    if (at.in_next > 0) narrow_[at.first + 1] += at.in_next * texel;
  }
  const Overlap at = overlap(rows_++, from_.height, to_.height);
  for (std::size_t x = 0; x < narrow_.size(); ++x) unfinished_[x] += at.in_first * narrow_[x];
  const bool is_last = rows_ == from_.height;
  const bool next_begins = is_last || overlap(rows_, from_.height, to_.height).first > at.first;
  if (!next_begins) return;
  finish_row();
  if (at.in_next > 0)
    for (std::size_t x = 0; x < narrow_.size(); ++x) unfinished_[x] += at.in_next * narrow_[x];
}

}  // namespace previz::scene
