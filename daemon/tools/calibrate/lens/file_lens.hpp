// The lenses of a file of another program, as data.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "daemon/tools/calibrate/lens/lens_file_tree.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

using AnyLens = std::variant<PinholeIntrinsics, FisheyeIntrinsics>;

// A lens in previzd's conventions: px, (0,0) is the centre of the top-left pixel. All numbers are
// finite and the focal lengths are above 0. The size is 0 x 0 where the file does not have it, and
// a fisheye's max_angle_rad is not set yet (complete_lens in lens_file_check.hpp).
struct FileLens {
  AnyLens lens;
  std::string model;               // as the file calls it
  FilePlace focal_at;              // of the focal lengths and the principal point
  std::string size_keys;           // that the file lacks or has: "image_width, image_height"
  std::vector<std::string> notes;  // what was assumed or converted
};

// A camera of the file: its lens, or why previzd cannot use it.
struct FileCamera {
  std::string name;  // printable; "" where the file has only one, without a name
  std::optional<FileLens> lens;
  std::string refusal;  // with the place; empty if there is a lens
};

struct LensFile {
  std::string format;
  std::vector<FileCamera> cameras;  // at least one
  std::vector<std::string> notes;
};

}  // namespace previz::calibrate
