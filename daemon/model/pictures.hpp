// Gives a person what is needed to mark points: pictures from different sides, and a file of parts
// to fill in.
#pragma once

#include <filesystem>
#include <ostream>

#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

inline constexpr int most_pictures = 8;

// Writes up to most_pictures pictures that show tags of the set, from as different places as there
// are, as PNG files into a folder, which is created, and beside them model.toml: a [[picture]] for
// each, a [[plane]] for each group of tags that lie in one plane, and an example of what else can
// be listed. Throws previz::Error if the footage shows no tag of the set, and if the folder has a
// model.toml already, which may hold somebody's marks.
void write_pictures(const std::filesystem::path& footage, const ObserverCalibration& camera,
                    const set::Tracking& tracking, const std::filesystem::path& folder,
                    std::ostream& out);

}  // namespace previz::model
