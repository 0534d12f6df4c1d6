#include "daemon/core/lighting/resampling.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <mutex>
#include <optional>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/parallel.hpp"
#include "shaders/lib/octahedral.h"

namespace previz::lighting {
namespace {

constexpr int least_samples = 4, most_samples = 64;  // per side of a cell

// The place in the picture where a direction lands; nothing beyond the lens's angle.
using Landing = std::optional<glm::dvec2>;

struct Hit {
  std::uint32_t pixel;
  float weight;  // share of a texel
};

class Gatherer {
 public:
  Gatherer(const Fisheye& lens, const Viewpoint& viewpoint, int size)
      : lens_(lens),
        viewpoint_(viewpoint),
        size_(size),
        cells_(std::max(size, resolution_for(lens.axis_pixel_sr()))) {}

  // Gathers the entries of texel rows begin..end-1; `counts` has one number per texel.
  void gather(int begin, int end, std::vector<std::uint32_t>& counts,
              std::vector<std::uint32_t>& pixels, std::vector<float>& weights) const {
    const int cells_a_side = cells_ / size_;
    std::vector<std::vector<Landing>> rows(static_cast<std::size_t>(cells_a_side) + 1);
    rows.back() = corner_row(begin * cells_a_side);
    std::vector<Hit> hits;
    for (int j = begin; j < end; ++j) {
      std::swap(rows.front(), rows.back());
      for (int c = 1; c <= cells_a_side; ++c)
        rows[static_cast<std::size_t>(c)] = corner_row(j * cells_a_side + c);
      for (int i = 0; i < size_; ++i) {
        hits.clear();
        for (int cj = 0; cj < cells_a_side; ++cj)
          for (int ci = 0; ci < cells_a_side; ++ci)
            sample_cell(i * cells_a_side + ci, j * cells_a_side + cj,
                        rows[static_cast<std::size_t>(cj)], rows[static_cast<std::size_t>(cj) + 1],
                        hits);
        counts.push_back(add_entries(hits, pixels, weights));
      }
    }
  }

 private:
  // Takes a position in the square, in cells.
  Landing land(double i, double j) const {
    const glm::vec2 point(static_cast<float>(2 * i / cells_ - 1),
                          static_cast<float>(2 * j / cells_ - 1));
    const auto direction = viewpoint_.camera_direction(glm::dvec3(octahedral_direction(point)));
    return direction ? lens_.project(*direction) : std::nullopt;
  }

  std::vector<Landing> corner_row(int j) const {
    std::vector<Landing> row(static_cast<std::size_t>(cells_) + 1);
    for (int i = 0; i <= cells_; ++i) row[static_cast<std::size_t>(i)] = land(i, j);
    return row;
  }

  // Returns whether the map is smooth inside a cell. It is not where it is folded along |u| + |v| =
  // 1, nor at the poles.
  bool smooth(int i, int j) const {
    const int u = std::abs(2 * i + 1 - cells_), v = std::abs(2 * j + 1 - cells_);
    return u + v != cells_ && u + v != 2 && u + v != 2 * cells_ - 2;
  }

  // Returns the samples per side of a cell that spans this much of the picture: at least two per
  // pixel.
  static int samples_across(double reach_px) {
    return std::clamp(2 * static_cast<int>(std::ceil(reach_px)), least_samples, most_samples);
  }

  // Appends the pixels of a cell's directions. Inside the picture they are interpolated from the
  // corners; if an edge, of the picture or between the room's surfaces, crosses the cell, every
  // direction is projected individually.
  void sample_cell(int i, int j, const std::vector<Landing>& above,
                   const std::vector<Landing>& below, std::vector<Hit>& hits) const {
    const auto left = static_cast<std::size_t>(i), right = left + 1;
    if (!above[left] && !above[right] && !below[left] && !below[right]) return;
    const bool all = above[left] && above[right] && below[left] && below[right];
    int samples = least_samples;
    bool interpolate = all && smooth(i, j);
    if (!viewpoint_.far_away()) {
      const double reach_px = all ? std::max(glm::distance(*above[left], *below[right]),
                                             glm::distance(*above[right], *below[left]))
                                  : 0;
      samples = samples_across(reach_px);
      interpolate = interpolate && samples == least_samples;
    }
    const int cells_a_side = cells_ / size_;
    const float weight = 1.0f / static_cast<float>(cells_a_side * cells_a_side * samples * samples);
    for (int b = 0; b < samples; ++b) {
      const double t = (b + 0.5) / samples;
      for (int a = 0; a < samples; ++a) {
        const double s = (a + 0.5) / samples;
        const Landing landing = interpolate ? glm::mix(glm::mix(*above[left], *above[right], s),
                                                       glm::mix(*below[left], *below[right], s), t)
                                            : land(i + s, j + t);
        if (!landing) continue;
        if (const auto pixel = lens_.pixel_at(*landing)) hits.push_back({*pixel, weight});
      }
    }
  }

  static std::uint32_t add_entries(std::vector<Hit>& hits, std::vector<std::uint32_t>& pixels,
                                   std::vector<float>& weights) {
    std::sort(hits.begin(), hits.end(),
              [](const Hit& a, const Hit& b) { return a.pixel < b.pixel; });
    const std::size_t before = pixels.size();
    for (std::size_t h = 0; h < hits.size();) {
      const std::uint32_t pixel = hits[h].pixel;
      float weight = 0;
      for (; h < hits.size() && hits[h].pixel == pixel; ++h) weight += hits[h].weight;
      pixels.push_back(pixel);
      weights.push_back(weight);
    }
    return static_cast<std::uint32_t>(pixels.size() - before);
  }

  const Fisheye& lens_;
  const Viewpoint& viewpoint_;
  int size_;
  int cells_;
};

}  // namespace

Resampling make_resampling(const Fisheye& lens, const Viewpoint& viewpoint, int size) {
  struct Block {
    int begin = 0;
    std::vector<std::uint32_t> counts, pixels;
    std::vector<float> weights;
  };
  const Gatherer gatherer(lens, viewpoint, size);
  std::vector<Block> blocks;
  std::mutex mutex;
  parallel_blocks(size, [&](int begin, int end) {
    Block block;
    block.begin = begin;
    gatherer.gather(begin, end, block.counts, block.pixels, block.weights);
    const std::lock_guard lock(mutex);
    blocks.push_back(std::move(block));
  });
  std::sort(blocks.begin(), blocks.end(),
            [](const Block& a, const Block& b) { return a.begin < b.begin; });

  Resampling result;
  result.size = size;
  result.first.push_back(0);
  for (const Block& block : blocks) {
    for (const std::uint32_t count : block.counts)
      result.first.push_back(result.first.back() + count);
    result.pixels.insert(result.pixels.end(), block.pixels.begin(), block.pixels.end());
    result.weights.insert(result.weights.end(), block.weights.begin(), block.weights.end());
  }
  return result;
}

Resampled resample(const Resampling& resampling, const HdrPicture& picture) {
  const std::size_t texels = resampling.first.size() - 1;
  Resampled result;
  result.size = resampling.size;
  result.radiance.resize(texels);
  result.seen.resize(texels);
  double over = 0, under = 0, changed = 0;
  for (std::size_t t = 0; t < texels; ++t) {
    glm::vec3 radiance(0);
    float seen = 0;
    for (std::uint32_t e = resampling.first[t]; e < resampling.first[t + 1]; ++e) {
      const std::uint32_t pixel = resampling.pixels[e];
      const float weight = resampling.weights[e];
      radiance += weight * picture.radiance[pixel];
      seen += weight;
      if (picture.flags[pixel] & overexposed) over += weight;
      if (picture.flags[pixel] & underexposed) under += weight;
      if (picture.flags[pixel] & moved) changed += weight;
    }
    result.radiance[t] = radiance;
    result.seen[t] = seen;
  }
  result.overexposed_sr = over * texel_sr(resampling.size);
  result.underexposed_sr = under * texel_sr(resampling.size);
  result.moved_sr = changed * texel_sr(resampling.size);
  return result;
}

}  // namespace previz::lighting
