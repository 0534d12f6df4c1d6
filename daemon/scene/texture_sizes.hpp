// Makes textures smaller where a scene has more of them than fit.
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <span>
#include <utility>
#include <vector>

#include "daemon/scene/picture_bytes.hpp"

namespace previz::scene {

// Returns the sizes of textures after the largest, of equal ones the last, was halved again and
// again until all have at most `most_texels` together. With `has_levels` a texture counts with all
// its levels (daemon/render/mip_levels.hpp).
std::vector<PictureSize> fitted_sizes(std::vector<PictureSize> sizes, bool has_levels,
                                      std::uint64_t most_texels);

// Averages a picture over the areas of fewer texels, row by row.
class AreaAverage {
 public:
  // `to` is no larger than `from` on either side, and at least 1. `by_alpha`, a colour counts as
  // much as its texel covers; where none covers, all count alike.
  AreaAverage(PictureSize from, PictureSize to, bool by_alpha = false);
  // Adds the next row of `from`.
  void add(std::span<const glm::vec4> row);
  // Returns the texels of `to`, after the last row.
  std::vector<glm::vec4> take() { return std::move(texels_); }

 private:
  void finish_row();

  PictureSize from_, to_;
  bool by_alpha_;
  int rows_ = 0;                        // added
  std::vector<glm::dvec4> narrow_;      // the row last added, in the texels of `to`
  std::vector<glm::dvec4> unfinished_;  // the sum of rows so far
  std::vector<glm::vec4> texels_;
};

}  // namespace previz::scene
