// Names formats of film and video that libav cannot decode, by their marks and the ends of names.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/core/session/av.hpp"

namespace previz::exchange {

// Whether the name ends as those of videos do, raw film included.
bool is_video_name(const std::filesystem::path& file);

// Returns what to say of a file that libav does not open, or in which it finds nothing to decode:
// what it is and which way leads on; "" if that is unknown. `opened` may be null.
std::string undecodable_words(const std::filesystem::path& file, const AVFormatContext* opened);

}  // namespace previz::exchange
