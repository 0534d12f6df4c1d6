// Checks a lens of another program's file against its picture, and completes it.
#pragma once

#include <optional>

#include "daemon/tools/calibrate/lens/lens_file.hpp"

namespace previz::calibrate {

struct PictureSize {
  int width = 0, height = 0;  // px

  friend bool operator==(const PictureSize&, const PictureSize&) = default;
};

// Parses "1920x1080". Throws previz::Error naming --size.
PictureSize parse_picture_size(const std::string& text);

PictureSize picture_size(const AnyLens& lens);

// Completes the lens by `size` if the file has none, and a fisheye by its max_angle_rad: that of
// the picture's farthest corner, or where the polynomial stops growing if that is less. Adds notes.
// Throws previz::Error with the place in the file and the remedy if
// - no size is given, or two that differ;
// - a focal length is not one in pixels: below 0.1 of the picture's longer side (of a fisheye
//   0.05). A pinhole would see 157 degrees along that side. Millimetres are seen by that;
// - the principal point is outside of the picture by more than half of its side;
// - a fisheye's polynomial stops growing within a quarter of the picture's shorter side;
// - a pinhole folds in its picture: undistort() gives nothing at a pixel of the edge.
void complete_lens(FileLens& lens, const std::optional<PictureSize>& size);

// Throws previz::Error naming the pixel if the lens folds in its picture.
void refuse_folds(const PinholeIntrinsics& lens, const FilePlace& place);

}  // namespace previz::calibrate
