// Reads the timecode that a file has for the first of its pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "daemon/core/session/av.hpp"
#include "daemon/tools/exchange/footage.hpp"

namespace previz::exchange {

// Containers have it as a track of its own, or as the video's or the file's own words. A track of
// QuickTime ("tmcd") has an edit list of its own, and counts by QuickTime's rule: the picture that
// is shown at a time has the timecode that the track has at that time. `shown` is the time of the
// first picture in the video track's time base; `url` is the file's name, which is opened again.
std::optional<FileTimecode> track_timecode(const AVFormatContext& file, int video_track,
                                           std::int64_t shown, const std::string& url);

}  // namespace previz::exchange
