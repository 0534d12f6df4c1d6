// Says in plain words what a damaged session lacks. Not for use outside this room.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace previz::session {

// Returns "1 frame", "24 frames".
std::string count_of(const std::string& noun, std::uint64_t count);
// Returns "frame 7", "frames 1, 3 to 5 and 9"; a long list ends "and 12 more". Numbers increase.
std::string list_of(const std::string& noun, const std::vector<std::uint64_t>& numbers);

}  // namespace previz::session
