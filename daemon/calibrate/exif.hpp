// What a photograph says about how it was taken.
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
  std::optional<double> focus_distance_m;  // of the subject
  std::string lens;                        // its model; may be empty
};

// Of a file without EXIF nothing is known; that is no error. Throws previz::Error if it cannot be
// read as a picture.
PhotoData read_exif(const std::filesystem::path& file);

}  // namespace previz::calibrate
