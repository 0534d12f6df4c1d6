// Writes a file of parts to begin with.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/model/parts.hpp"

namespace previz::model {

// Tags that lie in one plane, within 4 mm and 4 degrees.
struct TagPlane {
  std::string name;  // "plane 1"
  std::vector<int> tags;
};

// Returns the planes of a set's tags; every tag is in one.
std::vector<TagPlane> tag_planes(const std::vector<set::Tag>& tags);

// Returns the file's name of a picture that is written to be marked: "frame_7.png" of "frame 7".
std::string picture_file(const std::string& picture);

// Returns a file of parts that lists the pictures with their marks, the planes and the boxes;
// comments say how it goes on.
std::string parts_text(const std::vector<MarkedPicture>& pictures,
                       const std::vector<TagPlane>& planes, const std::vector<BoxPart>& boxes);

}  // namespace previz::model
