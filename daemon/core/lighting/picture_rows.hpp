// Puts a picture together from its rows, and makes it coarser meanwhile where it is too large to be
// kept.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/lighting/linear_picture.hpp"
#include "drivers/convert/area_average.hpp"

namespace previz::lighting {

class PictureRows {
 public:
  // Keeps at most `most_kept` pixels of a picture of this size: each stands for equally many
  // along both sides, a whole number where that keeps the picture's shape. The file has this many
  // bytes. Throws previz::Error naming the file where no smaller picture has its shape.
  PictureRows(const std::filesystem::path& path, int width, int height, std::int64_t most_kept);

  // Appends the next row from the top, `width` pixels, to the area means of the picture. A value of
  // +Inf is the largest half in a mean, as in repair().
  void append(std::span<const glm::vec3> row);
  // Returns the picture once all rows are there. What was made coarser is appended to `notes`.
  LinearPicture picture(std::vector<std::string>& notes) &&;

 private:
  std::filesystem::path path_;
  int width_, height_;
  LinearPicture picture_;
  std::optional<convert::AreaAverage<glm::dvec3>> average_;  // where it is made coarser
  std::int64_t overflowed_ = 0;                              // values of +Inf
};

}  // namespace previz::lighting
