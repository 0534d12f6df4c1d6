// Reads pictures of one scene at several exposures, for the response curve.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace previz::calibrate {

struct BracketPicture {
  std::string name;
  double exposure = 0;  // any unit that is the same for all
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  // codes of 8 bits, the nearest of deeper pictures
};

// Returns the pictures of a bracket, darkest first, no two of the same exposure (within 1 %). They
// are read from:
//   a session    the first frame of each exposure (shutter time times gain) of `stream`
//   a folder     its pictures; exposure times come from `exposures`, a text file of lines
//                "NAME SECONDS" (fractions as 1/60 too; what follows is ignored, as are lines that
//                begin with #), otherwise from the pictures' EXIF (time, aperture and ISO speed)
// Throws previz::Error naming the picture whose exposure is not known, and if fewer than 3 are left
// or they differ in size.
std::vector<BracketPicture> read_bracket(const std::filesystem::path& footage,
                                         const std::string& stream,
                                         const std::optional<std::filesystem::path>& exposures);

}  // namespace previz::calibrate
