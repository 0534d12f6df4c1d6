// Reads the corners that the crew marked on the rig while a take was recorded, and makes boxes of
// them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/model/parts.hpp"
#include "daemon/tools/model/views.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

struct RigMarks {
  std::vector<MarkedPicture> pictures;  // those with marks, as the take has them: "frame 7"
  Views views;                          // of these pictures, in their order
  std::vector<std::string> missing;     // what cannot be used, and why, in plain words
};

// Returns nothing of footage that is no session. Marks in a picture whose tags do not show where
// the camera was are not used. Throws previz::Error if the session cannot be read, or if its
// pictures are not of the lens's size.
RigMarks rig_marks(const std::filesystem::path& footage, const ObserverCalibration& camera,
                   const set::Tracking& tracking);

struct MarkedBoxes {
  std::vector<BoxPart> boxes;
  std::vector<std::string> remarks;  // what each stands on, and what others lack
};

// Returns the boxes whose three corners are each marked in two pictures or more, from two sides,
// and of which a model can be made. Each stands on the plane of tags that is nearest below its
// upper side and parallel to it: if there is one, on one that reaches below the box.
MarkedBoxes boxes_of(const RigMarks& marks, const std::vector<set::Tag>& tags,
                     const std::filesystem::path& footage);

// Returns the pictures without the marks that none of the boxes has.
std::vector<MarkedPicture> only_of(const std::vector<BoxPart>& boxes,
                                   std::vector<MarkedPicture> pictures);

// Returns the pictures of these names, and the marked ones, with their marks, in the order of the
// take. Without marks the names stay as they are.
std::vector<MarkedPicture> with_marks(const std::vector<std::string>& names, const RigMarks& marks);

}  // namespace previz::model
