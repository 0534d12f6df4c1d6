// Names what a file is that is no glTF, and says how an object is made of it.
#pragma once

#include <span>
#include <string>

namespace previz::scene {

// Throws previz::Error, "FILE: is an OBJ file; ...", if the bytes are of a known format other than
// glTF or of none, and the file's ending is that of a known one. Returns if neither says anything.
void refuse_other_format(std::span<const unsigned char> bytes, const std::string& file);

// Returns the format of a file that is no glTF by its name's ending, "a USDZ file" for example; ""
// if the ending is of no known one.
std::string format_by_ending(const std::string& file);

}  // namespace previz::scene
