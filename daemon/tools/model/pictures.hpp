// Gives a person what is needed to mark points: pictures from different sides, and a file of parts
// to fill in.
#pragma once

#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

inline constexpr int most_pictures = 8;

// Returns the names (short_name()) of up to most_pictures pictures that show tags of the set, from
// as different places as there are, in the order of the footage. Throws previz::Error if none does.
std::vector<std::string> pictures_apart(const std::filesystem::path& footage,
                                        const ObserverCalibration& camera,
                                        const set::Tracking& tracking);

// Writes those pictures, and the ones that were marked on the rig, as PNG files into a folder,
// which is created, and beside them model.toml: a [[picture]] for each, with its marks, a [[plane]]
// for each group of tags that lie in one plane, and the boxes that were marked, or an example of
// one. Throws previz::Error if the footage shows no tag of the set, and if the folder has a
// model.toml already, which may hold somebody's marks.
void write_pictures(const std::filesystem::path& footage, const ObserverCalibration& camera,
                    const set::Tracking& tracking, const std::filesystem::path& folder,
                    std::ostream& out);

}  // namespace previz::model
