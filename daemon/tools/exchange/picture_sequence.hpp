// Finds the files of a numbered sequence of pictures, and which of it are missing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace previz::exchange {

struct PictureSequence {
  std::vector<std::filesystem::path> files;
  // The position of each file's frame in the sequence, from 0, increasing. Numbers that are missing
  // count.
  std::vector<std::uint64_t> positions;
  std::uint64_t missing = 0;  // frames, also those of a range that are missing at its ends
  std::string words;          // "plate.%04d.png: 1004, 1005 are missing: 2 frames are lost", or ""
};

// Returns the files that match, in the order of their numbers. A file name may hold
//   %d, or %04d   a number, with at least so many digits
//   #### or @@@@  the same, with as many digits; one of them: any number of digits
//   $F or $F4     the same, as Houdini has it
//   * and ?       anything, or one letter: the frame's number is what differs in the names
// "plate.1001-1100####.png", "plate.%04d.png 1001-1100", "plate.[1001-1100].png" and
// "plate.{1001..1100}.png" name a range. Any other name is a file.
// A name with * or ? holds no other mark, and %d goes before the others. Where names differ in more
// than one number, or nearly all numbers would be missing, as with times in the names, they hold no
// numbers of frames and are used one after the other. Throws
// previz::Error if there is no such file, or a number is there twice.
PictureSequence picture_sequence(const std::filesystem::path& pattern);

// The sequence that has all of these files.
PictureSequence whole_sequence(std::vector<std::filesystem::path> files);

}  // namespace previz::exchange
