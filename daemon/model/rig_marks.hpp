// Reads the corners that the crew marked on the rig while a take was recorded, and makes boxes of
// them.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/model/parts.hpp"
#include "daemon/set/set.hpp"
#include "daemon/tracking/rays.hpp"
#include "drivers/calibration.hpp"
#include "drivers/session/marks.hpp"

namespace previz::model {

struct RigMarks {
  using Rays = std::array<std::vector<tracking::Ray>, session::corners_of_a_box>;

  std::vector<MarkedPicture> pictures;  // those with marks, as the take has them: "frame 7"
  std::map<std::size_t, Rays> boxes;    // by number, from 0; of each corner, a ray of each picture
  std::vector<std::string> missing;     // what cannot be used, and why, in plain words
};

// Returns nothing of footage that is no session. Marks in a picture whose tags do not show where
// the camera was are not used. Throws previz::Error if the session cannot be read.
RigMarks rig_marks(const std::filesystem::path& footage, const ObserverCalibration& camera,
                   const set::Tracking& tracking);

// Returns the boxes whose three corners are each marked in two pictures or more. Each stands on the
// plane of flat tags (parts_text.hpp) that is nearest below its upper side and parallel to it.
// Writes to `out` what cannot be used, which boxes are not complete, and what they lack.
std::vector<BoxPart> boxes_of(const RigMarks& marks, const std::vector<set::Tag>& tags,
                              std::ostream& out);

// Returns the pictures of these names, and the marked ones, with their marks, in the order of the
// take. Without marks the names stay as they are.
std::vector<MarkedPicture> with_marks(const std::vector<std::string>& names, const RigMarks& marks);

}  // namespace previz::model
