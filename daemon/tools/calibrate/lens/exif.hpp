// Reads how a photograph was taken.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace previz::calibrate {

struct PhotoData {
  std::optional<double> exposure_s;  // shutter time
  std::optional<double> f_number;
  std::optional<double> iso;  // speed rating
  std::optional<double> focal_length_m;
  std::optional<double> focus_distance_m;  // distance of the subject
  std::string lens;                        // the lens's model; may be empty
};

// Returns no values for a file without EXIF, which is no error. Throws previz::Error if the file
// cannot be read as a picture.
PhotoData read_exif(const std::filesystem::path& file);

}  // namespace previz::calibrate
