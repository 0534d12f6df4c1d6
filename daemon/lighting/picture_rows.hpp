// Puts a picture together from its rows, and makes it coarser meanwhile where it is too large to be
// kept.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "daemon/lighting/linear_picture.hpp"

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
  void add(std::span<const glm::vec3> row);
  void finish_row();

  std::filesystem::path path_;
  int width_, height_;
  LinearPicture picture_;
  double scale_ = 1;                // pixels of the file for one of the picture, along a side
  int rows_ = 0;                    // appended so far
  std::int64_t overflowed_ = 0;     // values of +Inf
  std::vector<glm::dvec3> across_;  // means of the last row over the picture's columns
  std::vector<glm::dvec3> sums_;    // of the picture's unfinished row
};

}  // namespace previz::lighting
