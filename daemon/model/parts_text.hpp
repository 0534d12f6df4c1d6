// Writes a file of parts to begin with.
#pragma once

#include <string>
#include <vector>

#include "daemon/model/parts.hpp"
#include "daemon/set/set.hpp"

namespace previz::model {

// Returns the ids of the tags that lie in one plane, within 4 mm and 4 degrees, for each such
// plane; every tag is in one.
std::vector<std::vector<int>> flat_groups(const std::vector<set::Tag>& tags);
// Returns the name that the plane of a group has in a file of parts: "plane 1" of the first.
std::string plane_name(std::size_t group);

// Returns the file's name of a picture that is written to be marked: "frame_7.png" of "frame 7".
std::string picture_file(const std::string& picture);

// Returns a file of parts that lists the pictures with their marks, the planes of the flat tags,
// and boxes; comments say how it goes on.
std::string parts_text(const std::vector<MarkedPicture>& pictures,
                       const std::vector<set::Tag>& tags, const std::vector<BoxPart>& boxes);

}  // namespace previz::model
